"""The protocol of bodies: methods trained on one recording, and the report."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ico3d.body.reposing import fit_poses
from ico3d.errors import SettingsError
from ico3d.measure.methods.settings import preset
from ico3d.protocols import body as protocol
from ico3d.protocols.commands import MeasureBody
from support.bodies.moving_capture import FRAMES, MovingCapture
from support.bodies.tracked_capture import TrackedCapture
from support.captures import open_with
from support.settings import changed

pytestmark = pytest.mark.slow

TINY = {
    "windows.longest": 6,
    "windows.shortest": 3,
    "initial.gaussians": 60,
    "density.max_gaussians": 90,
    "steps_per_frame": 3,
    "warmup_steps": 4,
    "density.begin": 5,
    "density.every": 5,
    "encoder.space": 4,
    "mlp.width": 8,
    "finetune.steps": 6,
}


def figures_in(folder: Path) -> dict:
    """All figures of the report in a folder."""
    return json.loads((folder / "report.json").read_text())["figures"]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A bench of a tiny capture, and what it found."""
    folder = tmp_path_factory.mktemp("bench")
    with pytest.MonkeyPatch.context() as patch:
        open_with(patch, MovingCapture)
        command = MeasureBody(
            folder / "capture",
            folder / "runs",
            methods=("swings++", "freetime", "static"),
            settings=changed(preset("swings++"), TINY),
            finetune=True,
        )
        with patch.context() as undrawn:  # what both runs would draw, the second does
            undrawn.setattr(protocol, "_pictures", lambda *_: [])
            command.run()
        first = figures_in(folder / "runs")
        written = {path: path.stat().st_mtime_ns for path in folder.rglob("window.safetensors")}
        command.run()
    return folder, first, figures_in(folder / "runs"), written


def test_figures_of_a_bench(bench):
    _, figures, _, _ = bench
    windows = figures["windows"]
    assert windows[0][0] == 0 and windows[-1][1] == FRAMES - 1 and len(windows) > 1
    assert set(figures["margins"]) == {"freetime", "static"}
    for method in ("swings++", "freetime", "static"):
        (result,) = figures[method]["seeds"]
        assert result["psnr_mask"] == figures[method]["mean"]["psnr_mask"] > 5
        assert len(result["psnr_mask_per_window"]) == len(windows)
        assert result["num_gaussians"] <= 90 * len(windows) and result["train_seconds"] > 0
    ours, static = figures["swings++"]["mean"], figures["static"]["mean"]
    assert figures["margins"]["static"]["psnr_mask"] == pytest.approx(
        ours["psnr_mask"] - static["psnr_mask"]
    )
    assert figures["freetime"]["mean"]["flicker"] is None and static["flicker"] > 0
    after = figures["finetune"]["after"]
    assert figures["finetune"]["before"]["flicker"] == ours["flicker"] != after["flicker"]


def test_the_report_tells_what_was_measured_and_shows_it(bench):
    folder, figures, _, _ = bench
    text = (folder / "runs" / "report.md").read_text()
    mean = figures["swings++"]["mean"]
    row = next(line for line in text.splitlines() if line.startswith("| swings++ |"))
    assert f"{mean['psnr_mask']:.2f}" in row and f"{mean['ssim']:.4f}" in row
    assert "Not measured here: LPIPS" in text and "- seeds: 0" in text
    assert "- device: cpu" in text and "test cameras: " in text
    for name in ("quality.png", "windows.png", "strip.png"):
        assert f"]({name})" in text
        picture = np.asarray(Image.open(folder / "runs" / name).convert("RGB"))
        assert picture.std() > 10, name
    facts = json.loads((folder / "runs" / "report.json").read_text())["facts"]
    assert "max_gaussians=90" in facts["settings"]["swings++"]


def test_the_same_command_trains_nothing_twice(bench):
    folder, first, second, written = bench
    again = {path: path.stat().st_mtime_ns for path in folder.rglob("window.safetensors")}
    assert again == written and len(written) > 4
    assert first == second


def test_frames_that_were_not_trained(tmp_path, monkeypatch):
    """On a skeleton the body follows the track there; elsewhere it stays where it was."""
    open_with(monkeypatch, TrackedCapture)
    monkeypatch.setattr(fit_poses, "STEPS", 7)
    command = MeasureBody(
        tmp_path / "capture",
        tmp_path / "runs",
        methods=("static", "hugs"),
        settings=changed(preset("swings++"), TINY | {"steps_per_frame": 20}),
        frames=6,
        unseen=True,
    )
    command.run()
    figures = figures_in(tmp_path / "runs")
    still, hugs = (figures[method]["mean"]["unseen_psnr_mask"] for method in ("static", "hugs"))
    assert hugs > still + 0.5
    fitted = figures["hugs"]["mean"]["unseen_fitted_psnr_mask"]
    assert abs(fitted - hugs) < 3 and fitted != hugs
    assert "unseen_fitted_psnr_mask" not in figures["static"]["mean"]
    assert "Poses that trained nothing" in (tmp_path / "runs" / "report.md").read_text()
    with pytest.raises(SettingsError, match="--unseen needs --frames"):
        replace(command, frames=None).run()
    with pytest.raises(SettingsError, match="--seeds"):
        replace(command, seeds=0).run()
