"""Training is killed, meets a full disk and a damaged checkpoint, and gives the same head."""

import json
import random
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from safetensors.torch import load_file

from ico3d.errors import StorageError
from ico3d.head import model
from ico3d.head.train_head import HeadJob, train_head
from ico3d.training.processes import fork_server
from ico3d.training.run import BEFORE, CHECKPOINT
from support.full_disk import files_of_at_most
from support.heads.train_tiny import PAPER, SETTINGS, train_as_paper, train_tiny
from support.settings import changed
from support.weights.lpips import write_vgg

pytestmark = pytest.mark.slow

KILLS = 5
"""Every second one comes while a checkpoint is being written."""


@pytest.fixture(scope="module")
def processes():
    """Starts real processes in which everything heavy is imported already."""
    return fork_server("ico3d.head.train_head")


def _started(processes, folder: Path, begun: int):
    """A process that trains, once it has opened the `begun`-th event file of TensorBoard."""
    process = processes.Process(target=train_tiny, args=(folder,))
    process.start()
    _await(process, lambda: len(list(folder.glob("model/tensorboard/*"))) >= begun)
    return process


def _await(process, condition: Callable[[], bool]) -> None:
    """Waits for what a process at work shall do."""
    deadline = time.monotonic() + 60
    while not condition():
        assert process.is_alive(), f"training ended by itself: {process.exitcode}"
        assert time.monotonic() < deadline, "training stands still"
        time.sleep(0.001)  # shorter than a checkpoint takes to be written


def test_killed_five_times_it_gives_the_same_head_bit_for_bit(processes, tmp_path):
    whole = _started(processes, tmp_path / "whole", 1)
    rng = random.Random(0)
    for kill in range(KILLS):
        process = _started(processes, tmp_path / "parts", kill + 1)
        time.sleep(rng.uniform(0, 0.2))
        if kill % 2:
            _await(process, lambda: any((tmp_path / "parts/model").glob(".checkpoint.*")))
        process.kill()
        process.join()
        assert process.exitcode == -9, "it was to be killed, and ended before"
    last = _started(processes, tmp_path / "parts", KILLS + 1)
    for process in (whole, last):
        process.join()
        assert process.exitcode == 0
    models = [
        load_file(tmp_path / name / "model" / "model.safetensors") for name in ("whole", "parts")
    ]
    assert models[0].keys() == models[1].keys()
    for name, tensor in models[0].items():
        assert tensor.equal(models[1][name]), name
    _assert_tidy(tmp_path / "parts" / "model")


def test_the_papers_settings_are_killed_and_give_the_same_head_bit_for_bit(
    processes, tmp_path, monkeypatch
):
    """SGD, VGG from the first step, harmonics and growing; what was used is written down."""
    models = tmp_path / "models"
    models.mkdir()
    write_vgg(models)
    (tmp_path / "whole").mkdir()
    (tmp_path / "whole" / "models").symlink_to(models)
    killed = processes.Process(target=train_as_paper, args=(tmp_path, 13))
    killed.start()
    monkeypatch.setenv("ICO3D_MODELS", str(models))
    train_as_paper(tmp_path / "whole")
    killed.join()
    assert killed.exitcode == -9 and (tmp_path / "model" / "checkpoint.safetensors").is_file()
    train_as_paper(tmp_path)
    whole, parts = (
        load_file(folder / "model" / "model.safetensors")
        for folder in (tmp_path / "whole", tmp_path)
    )
    assert len(whole["means"]) > PAPER.initial.gaussians
    assert whole["harmonics_branch.weight"].abs().max() > 0
    assert whole.keys() == parts.keys()
    for name, tensor in whole.items():
        assert tensor.equal(parts[name]), name
    made = json.loads((tmp_path / "model" / "head.json").read_text())["summary"]["made"]
    assert made["seed"] == 0 and len(made["environments"]) == 1
    assert made["used"] == {
        "optimiser": "sgd",
        "sh_degree": 3,
        "perceptual": 0.1,
        "mixed_precision": False,
        "encoder": None,
    }


def test_a_head_goes_on_after_a_full_disk_and_after_a_damaged_checkpoint(
    tiny, tmp_path, caplog, monkeypatch
):
    few = {"steps": 16, "checkpoint_every": 4, "initial.gaussians": 100}
    job = HeadJob("blendshapes", "full", "builtin", 0, changed(SETTINGS, few))
    train_head(tiny, tmp_path / "whole", job)
    whole = (tmp_path / "whole" / "model.safetensors").read_bytes()
    parts = tmp_path / "parts"
    with (
        files_of_at_most(len(whole) // 2),
        pytest.raises(StorageError, match=r"checkpoint\.safetensors cannot be written"),
    ):
        train_head(tiny, parts, job)
    assert not (parts / CHECKPOINT).exists() and not list(parts.glob(".*"))
    with monkeypatch.context() as patched:  # so that writing the model fails, after all steps
        patched.setattr(model, "save_tensors", _fail)
        with pytest.raises(StorageError, match="full when the model is written"):
            train_head(tiny, parts, job)
    assert (parts / BEFORE).is_file() and not (parts / "model.safetensors").exists()
    (parts / CHECKPOINT).write_bytes((parts / CHECKPOINT).read_bytes()[:-1])
    train_head(tiny, parts, job)
    assert "Training goes on from the checkpoint before, at step 8." in caplog.text
    assert (parts / "model.safetensors").read_bytes() == whole


def _fail(*_):
    raise StorageError("the disk is full when the model is written.")


def _assert_tidy(folder: Path) -> None:
    """Nothing unfinished is left, and the metrics are those of one run."""
    assert not [path.name for path in folder.iterdir() if path.name.startswith(".")]
    assert not (folder / "checkpoint.safetensors").exists()
    lines = (folder / "metrics.jsonl").read_text().splitlines()
    assert [json.loads(line)["step"] for line in lines] == [
        *range(0, SETTINGS.steps, 50),
        SETTINGS.steps - 1,
    ]
