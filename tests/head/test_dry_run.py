"""What a dry run says of a head's training, and what the training then takes."""

import time

import numpy as np
import pytest

from ico3d.errors import CaptureError
from ico3d.head.optimise import HeadTrainer
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, needs_of_head, train_head
from ico3d.training.checkpoint import load_tensors
from ico3d.training.run import CHECKPOINT, RunFolder
from support.heads.tiny_capture import TinyCapture
from support.settings import changed

pytestmark = pytest.mark.slow

SETTINGS = changed(
    PRESETS["cpu"],
    {
        "steps": 60,
        "checkpoint_every": 40,
        "initial.gaussians": 200,
        "density.max_gaussians": 400,
        "density.begin": 10,
        "density.every": 10,
        "density.until": 35,
        "density.gradient": 1e-5,
    },
)
JOB = HeadJob("blendshapes", "full", "builtin", 0, SETTINGS)
SECONDS = 1e-3
"""What a step takes for each Gaussian, on a clock that nothing else on the machine moves."""


def test_a_dry_run_says_what_the_run_takes(tiny, tmp_path, monkeypatch):
    clock, step = [0.0], HeadTrainer.step

    def ticking(self, index):
        clock[0] += SECONDS * len(self)
        return step(self, index)

    monkeypatch.setattr(HeadTrainer, "step", ticking)
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    needs = needs_of_head(tiny, JOB)
    assert list(tmp_path.iterdir()) == []
    save, checkpoints = RunFolder.save_checkpoint, []

    def watched(self, tensors, state):
        save(self, tensors, state)
        checkpoints.append((self.path / CHECKPOINT).stat().st_size)

    monkeypatch.setattr(RunFolder, "save_checkpoint", watched)
    head = train_head(tiny, tmp_path / "run", JOB)
    assert needs.seconds == pytest.approx((60 * 200 * SECONDS, 60 * 400 * SECONDS))
    assert needs.seconds[0] < head.summary["train_seconds"] < needs.seconds[1]
    assert needs.begin.gaussians < len(head.model) <= needs.end.gaussians == 400
    header = 20_000
    assert needs.begin.saved < checkpoints[0] <= needs.end.saved + header
    model = (tmp_path / "run" / "model.safetensors").stat().st_size
    assert needs.begin.kept < model <= needs.end.kept + header
    pixels = sum(c.width * c.height for c in tiny.cameras) / len(tiny.cameras)
    views = len([f for f in tiny.split.train for c in (0, 1) if tiny.has_image(c, f)])
    assert needs.pictures == needs.cached == views * pixels * 4  # RGB and mask
    said = "\n".join(needs.lines(tmp_path / "none" / "yet"))
    assert "for 60 steps" in said and "GB are free" in said and "cache-dir" not in said


class Damaged(TinyCapture):
    """One of the pictures is damaged."""

    def image_bytes(self, camera, frame, box=None):
        if (camera, frame) == (3 % 2, 3):
            raise CaptureError("the picture of frame 3 is damaged.")
        return super().image_bytes(camera, frame, box)


def test_training_goes_on_without_a_damaged_picture_and_resumes_exactly(
    tmp_path, caplog, monkeypatch
):
    capture = Damaged(tmp_path / "tiny")
    train_head(capture, tmp_path / "whole", JOB)
    assert caplog.text.count("frame 3 is damaged. Training goes on without this picture.") == 1
    save = RunFolder.save_checkpoint

    def dying(self, tensors, state):
        save(self, tensors, state)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(RunFolder, "save_checkpoint", dying)
        train_head(capture, tmp_path / "parts", JOB)
    train_head(capture, tmp_path / "parts", JOB)
    whole, parts = (
        load_tensors(tmp_path / name / "model.safetensors")[0] for name in ("whole", "parts")
    )
    assert all(np.array_equal(whole[name], parts[name]) for name in whole)
