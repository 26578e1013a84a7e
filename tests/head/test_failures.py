"""A disk that is full while a head is trained, and a newest checkpoint that is damaged."""

import pytest

from ico3d.errors import StorageError
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.training.run import BEFORE, CHECKPOINT
from support.full_disk import files_of_at_most
from support.settings import changed

SETTINGS = changed(
    PRESETS["cpu"],
    {"steps": 16, "checkpoint_every": 4, "initial.gaussians": 100, "density.max_gaussians": 100},
)
JOB = HeadJob("blendshapes", "full", "builtin", 0, SETTINGS)
MODEL = "model.safetensors"


def test_a_head_goes_on_after_a_full_disk_and_after_a_damaged_checkpoint(tiny, tmp_path, caplog):
    train_head(tiny, tmp_path / "whole", JOB)
    whole = (tmp_path / "whole" / MODEL).read_bytes()
    parts = tmp_path / "parts"
    with (
        files_of_at_most(len(whole) // 2),
        pytest.raises(StorageError, match=r"checkpoint\.safetensors cannot be written"),
    ):
        train_head(tiny, parts, JOB)
    assert not (parts / CHECKPOINT).exists() and not list(parts.glob(".*"))
    (parts / MODEL).mkdir()  # so that writing the model fails, after all steps
    with pytest.raises(OSError, match="directory"):
        train_head(tiny, parts, JOB)
    (parts / MODEL).rmdir()
    assert (parts / BEFORE).is_file()
    (parts / CHECKPOINT).write_bytes((parts / CHECKPOINT).read_bytes()[:-1])
    train_head(tiny, parts, JOB)
    assert "Training goes on from the checkpoint before, at step 8." in caplog.text
    assert (parts / MODEL).read_bytes() == whole
