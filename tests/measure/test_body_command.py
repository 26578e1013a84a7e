"""`ico3d evaluate` of a body folder."""

import json

import numpy as np
import pytest
from PIL import Image

from ico3d.body.model_folder import UNTUNED
from ico3d.errors import ModelError
from ico3d.measure.commands import Evaluate
from ico3d.measure.methods.plots import plot_body
from support.bodies.moving_capture import FRAMES, MovingCapture
from support.bodies.true_body import still_body
from support.captures import open_with


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A body folder; `open_capture` gives the capture of what it shows at frame 0."""
    open_with(monkeypatch, MovingCapture)
    still_body(MovingCapture(tmp_path), tmp_path / "body")
    return tmp_path


def _evaluated(folder, **arguments) -> dict:
    Evaluate(folder / "body", folder, folder / "out.json", **arguments).run()
    return json.loads((folder / "out.json").read_text())


def test_it_recognises_a_body_and_writes_everything(folder, capsys):
    scores = _evaluated(folder, images=folder / "images", plots=folder / "plots")
    assert scores["per_frame"][0]["psnr_mask"] > 60  # the shared one is stored in logits
    assert scores["per_frame"][8]["psnr_mask"] < 30
    assert scores["psnr_moving"] < scores["psnr_mask"] and scores["flicker"] == 0
    tested = [f"c{index}" for index in MovingCapture(folder).split.test_cameras]
    written = sorted(str(p.relative_to(folder / "images")) for p in folder.rglob("images/*/*/*"))
    assert written == [
        f"{part}/{camera}/{frame:06d}.png"
        for part in ("gt", "mask", "pred")
        for camera in tested
        for frame in range(FRAMES)
    ]
    printed = capsys.readouterr().out
    assert "psnr_moving" in printed and "per_camera" not in printed


def test_all_cameras_on_demand(folder):
    scores = _evaluated(folder, frames="all")
    assert len(scores["per_camera"]) == len(MovingCapture(folder).cameras)


def _pixels(path):
    return np.array(Image.open(path).convert("RGB"), int)


def test_plots_show_borders_and_cameras(folder):
    scores = _evaluated(folder, plots=folder / "plots")
    plot_body(scores | {"per_border": []}, folder / "borderless")
    paths = [folder / name / "frames.png" for name in ("plots", "borderless")]
    changed = (_pixels(paths[0]) != _pixels(paths[1])).any(-1)
    rows, columns = np.flatnonzero(changed.any(1)), np.flatnonzero(changed.any(0))
    assert len(columns) <= 3 and np.ptp(rows) > 400  # a line from the bottom to the top
    blue = _pixels(folder / "plots" / "cameras.png") - (0x22, 0x55, 0xAA)
    bars = np.diff((np.abs(blue).max(-1) < 8).any(0).astype(int)) == 1
    assert bars.sum() == len(MovingCapture(folder).split.test_cameras)


def test_as_it_was_before_fine_tuning(folder):
    with pytest.raises(ModelError, match=r"untuned\.json"):
        _evaluated(folder, untuned=True)
    still_body(MovingCapture(folder), folder / "body", about=UNTUNED, frame=8)
    before, after = _evaluated(folder, untuned=True), _evaluated(folder)
    assert before["per_frame"][8]["psnr_mask"] > 60 > 30 > after["per_frame"][8]["psnr_mask"]
