"""The paper's settings for bodies, with all that they switch on (300 steps: bench/paper.py)."""

import json

import pytest
import torch

from ico3d.body.model_folder import TrainedBody, load_window
from ico3d.body.settings import settings_for
from ico3d.body.training.finetune_window import FineTuner
from ico3d.body.training.optimise_window import BodyTrainer
from ico3d.body.training.train_clip import BodyJob, train_body
from ico3d.errors import SettingsError
from support.bodies.moving_capture import MovingCapture
from support.bodies.tracked_capture import TrackedCapture
from support.settings import changed
from support.weights.raft import NAME, install_torchvision, write_raft

pytestmark = pytest.mark.slow

FEW = {
    "steps": 16,
    "warmup_steps": 3,
    "sh_degree": 3,
    "sh_every": 4,
    "color_correction": True,
    "encoder.space": 16,
    "windows.longest": 6,
    "windows.shortest": 3,
    "initial.gaussians": 80,
    "density.max_gaussians": 160,
    "density.begin": 4,
    "density.every": 5,
    "density.until": 0.9,
    "density.gradient": 1e-7,
    "checkpoint_every": 6,
    "finetune.steps": 8,
}
DEATHS = {BodyTrainer: 9, FineTuner: 7}
"""Steps before which a run is interrupted."""


def _job(method: str, **changes) -> BodyJob:
    return BodyJob(method, 0, changed(settings_for("paper", method), FEW | changes))


def _interrupted(monkeypatch, kind, run):
    """Runs until the step of a trainee dies."""
    step = kind.step

    def dying_step(self, index):
        if index == DEATHS[kind]:
            raise KeyboardInterrupt
        return step(self, index)

    with monkeypatch.context() as patch:
        patch.setattr(kind, "step", dying_step)
        with pytest.raises(KeyboardInterrupt):
            run()


def test_interrupted_it_gives_the_same_body_bit_for_bit(tmp_path, monkeypatch):
    """RAFT, harmonics, colour maps and growing; what was used is written down."""
    install_torchvision(monkeypatch, tmp_path)
    write_raft(tmp_path, 2.0)
    capture, job = MovingCapture(tmp_path / "capture"), _job("swings++")
    whole = train_body(capture, tmp_path / "whole", job)
    parts = tmp_path / "parts"
    for kind in DEATHS:
        _interrupted(monkeypatch, kind, lambda: train_body(capture, parts, job))
    resumed = train_body(capture, parts, job)
    assert len(whole.windows) == 2
    for ours, theirs in zip(resumed.models, whole.models, strict=True):
        assert len(theirs) > 80 and theirs.gaussians["harmonics"].abs().max() > 0
        for held, wanted in ((ours.gaussians, theirs.gaussians), (ours.shared, theirs.shared)):
            assert held.keys() == wanted.keys()
            assert all(torch.equal(held[name], value) for name, value in wanted.items())
        assert torch.equal(ours.camera_colors, theirs.camera_colors)
    _assert_colors_kept(parts)
    made = json.loads((parts / "body.json").read_text())["summary"]["made"]
    assert made["used"] == {
        "optimiser": "adam",
        "flow": NAME,
        "sh_degree": 3,
        "color_correction": True,
    }
    assert [one["device"] for one in made["environments"]] == ["cpu"]


def _assert_colors_kept(folder):
    """Fine-tuning leaves the maps of the cameras' colours as the window's training found them."""
    trained = load_window(folder / "windows/0001/window.safetensors").camera_colors
    tuned = load_window(folder / "finetuned/0001/window.safetensors").camera_colors
    assert torch.equal(trained, tuned)
    assert (trained - torch.eye(3, 4)).abs().max() > 1e-3


def test_a_skeleton_takes_neither_harmonics_nor_segments(tmp_path):
    """One sentence, before a folder is made."""
    for change in ({"sh_degree": 1}, {"windows.segment": 45, "sh_degree": 0}):
        with pytest.raises(SettingsError, match="are not for --method skinned"):
            train_body(TrackedCapture(tmp_path), tmp_path / "body", _job("skinned", **change))
    assert not (tmp_path / "body").exists()


def test_spacetime_gaussians_are_trained_in_segments(tmp_path):
    """Of 45 frames in the paper, apart from one another; here of 3."""
    settings = settings_for("paper", "spacetime")
    assert (settings.windows.segment, settings.finetune.steps) == (45, 0)
    few = {"steps": 2, "windows.segment": 3, "finetune.steps": 0}
    train_body(MovingCapture(tmp_path / "capture"), tmp_path / "body", _job("spacetime", **few))
    body = TrainedBody.load(tmp_path / "body")
    assert [(w.first, w.last) for w in body.windows] == [(0, 3), (3, 5), (5, 8)]
    assert body.summary["made"]["used"]["flow"] is None
