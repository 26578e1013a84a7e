"""Bodies whose training meets a full disk, NaN, or a damaged checkpoint: they go on exactly."""

from dataclasses import replace

import pytest
import torch

from ico3d.body.training.picture_step import Learner
from ico3d.body.training.train_clip import train_body
from ico3d.errors import ModelError, StorageError
from ico3d.training.listing.find_runs import find_runs
from ico3d.training.run import CHECKPOINT
from support.bodies.moving_capture import MovingCapture
from support.bodies.tiny_training import job
from support.full_disk import files_of_at_most

pytestmark = pytest.mark.slow

JOB = job(checkpoint_every=4, **{"finetune.consistency": 0.0})


def poisoned(monkeypatch, at: int, count: int) -> None:
    """The picture of a step holds NaN, in the training of that number, from 0."""
    example, begun = Learner.example, []

    def torn(self, view, index):
        if self not in begun:
            begun.append(self)
        found = example(self, view, index)
        if index == at and begun.index(self) == count:
            return replace(found, target=torch.full_like(found.target, torch.nan))
        return found

    monkeypatch.setattr(Learner, "example", torn)


def files(folder):
    return {
        str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.safetensors")
    }


def test_a_body_goes_on_after_a_full_disk_nan_and_a_damaged_checkpoint(
    tmp_path, monkeypatch, caplog
):
    capture = MovingCapture(tmp_path / "capture")
    train_body(capture, tmp_path / "whole", JOB)
    whole, parts = files(tmp_path / "whole"), tmp_path / "parts"
    for number, saved in ((2, 0), (10, 8)):
        said = rf"is not finite at step {number}: .*goes on from step {saved}\)"
        with monkeypatch.context() as patch, pytest.raises(ModelError, match=said):
            poisoned(patch, number, 0)
            train_body(capture, parts, JOB)
        with files_of_at_most(20_000), pytest.raises(StorageError, match=r"checkpoint.* is full"):
            train_body(capture, parts, JOB)
    with monkeypatch.context() as patch, pytest.raises(ModelError, match="goes on from step 8"):
        poisoned(patch, 11, 1)
        train_body(capture, parts, JOB)
    (parts / "windows/0001" / CHECKPOINT).write_bytes(b"")
    (run,) = find_runs(parts)
    assert (run.kind, run.step, run.steps, run.state) == ("body", 24, 46, "interrupted")
    said = r"is not finite at step 4: .*goes on from step 4\)"
    with monkeypatch.context() as patch, pytest.raises(ModelError, match=said):
        poisoned(patch, 4, 1)  # of fine-tuning, which comes after the second window
        train_body(capture, parts, JOB)
    assert "Training goes on from the checkpoint before, at step 4." in caplog.text
    train_body(capture, parts, JOB)
    assert files(parts) == whole
    (run,) = find_runs(parts)
    assert (run.step, run.steps, run.state) == (46, 46, "finished")
