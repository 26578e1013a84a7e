"""Protocols train and measure on the device that they are told, and their reports say so."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ico3d.cli import main
from ico3d.head.settings import PRESETS
from ico3d.measure.methods.settings import preset
from ico3d.measure.pictures import lpips
from ico3d.protocols import viewer
from ico3d.protocols.ablations import AblationTerms, measure_ablations
from ico3d.protocols.commands import MeasureBody, MeasurePortrait
from ico3d.splat.device import device_name
from support.avatars.whole_person import write_whole_person
from support.bodies.moving_capture import MovingCapture
from support.captures import open_with
from support.heads.tiny_capture import TinyCapture
from support.pretended_cuda import drawn
from support.settings import changed
from support.weights.lpips import write_weights

pytestmark = pytest.mark.slow

FEW = {"steps": 2, "initial.gaussians": 60, "density.max_gaussians": 90}
FEW_OF_A_BODY = {
    "windows.longest": 8,
    "initial.gaussians": 60,
    "density.max_gaussians": 90,
    "steps_per_frame": 1,
    "warmup_steps": 1,
    "finetune.steps": 0,
}


@pytest.fixture(autouse=True)
def no_plots(monkeypatch):
    """They are drawn by the CPU anyway, and take half of the time."""
    monkeypatch.setattr(
        "matplotlib.figure.Figure.savefig",
        lambda figure, file, **options: Path(file).write_bytes(b"PNG"),
    )


@pytest.fixture(autouse=True)
def no_models(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path / "models"))
    monkeypatch.setenv("HOME", str(tmp_path))


def _told(out: Path) -> dict:
    """What a report says."""
    return json.loads((out / "report.json").read_text())


def test_the_viewer(cuda, tmp_path, monkeypatch):
    monkeypatch.setattr(viewer, "SIZES", ((24, 16),))
    monkeypatch.setattr(viewer, "PICTURES", 2)
    write_whole_person(tmp_path / "avatar")
    words = ["measure", "viewer", tmp_path / "avatar", tmp_path / "out", "--device", "cuda"]
    with drawn(monkeypatch) as pictures:
        assert main([*map(str, words)]) == 0
    assert len(pictures) == 3 * (2 + viewer.WARM)
    told = _told(tmp_path / "out")
    assert told["facts"]["device"] == device_name(cuda)
    assert [row["name"] for row in told["figures"]["rows"]] == ["body", "head", "body + head"]
    assert all(row["peak_mib"] > 0 for row in told["figures"]["rows"])


def test_portraits(cuda, tmp_path, monkeypatch):
    open_with(monkeypatch, TinyCapture)
    settings = changed(PRESETS["cpu"], FEW)
    verb = MeasurePortrait(tmp_path / "capture", tmp_path / "out", over_torso=False)
    with drawn(monkeypatch) as pictures:
        replace(verb, settings=settings, device="cuda").run()
    assert len(pictures) > 2
    (row,) = _told(tmp_path / "out")["figures"]["self-driven"]
    assert row["device"] == device_name(cuda)


def test_bodies(cuda, tmp_path, monkeypatch):
    open_with(monkeypatch, MovingCapture)
    settings = changed(preset("swings++"), FEW_OF_A_BODY)
    verb = MeasureBody(tmp_path / "capture", tmp_path / "out", methods=("static",))
    with drawn(monkeypatch) as pictures:
        replace(verb, settings=settings, device="cuda").run()
    assert len(pictures) > 2
    assert _told(tmp_path / "out")["facts"]["device"] == device_name(cuda)


def test_ablations(cuda, tmp_path, monkeypatch):
    open_with(monkeypatch, TinyCapture)
    monkeypatch.setitem(PRESETS, "cpu", changed(PRESETS["cpu"], FEW))
    terms = AblationTerms(tmp_path / "capture", tmp_path / "out", "head", only=("no MLP",))
    report = measure_ablations(replace(terms, inputs="blendshapes", device="cuda"))
    assert report.facts["device"] == device_name(cuda)
    found = [row["device"] for rows in report.figures.values() for row in rows]  # type: ignore
    assert found == [device_name(cuda)] * 2


def test_anybodys_renders(cuda, tmp_path, monkeypatch):
    """Networks that compare pictures look at them there."""
    (tmp_path / "models").mkdir()
    write_weights(tmp_path / "models")
    lpips._installed.cache_clear()
    for name in ("recorded", "rendered"):
        (tmp_path / name).mkdir()
        picture = np.random.default_rng(len(name)).integers(0, 255, (32, 32, 3), np.uint8)
        Image.fromarray(picture).save(tmp_path / name / "0.png")
    words = ["measure", "renders", tmp_path / "out", "--recorded", tmp_path / "recorded"]
    words += ["--rendered", tmp_path / "rendered", "--device", "cuda"]
    assert main([*map(str, words)]) == 0
    lpips._installed.cache_clear()
    told = _told(tmp_path / "out")
    assert told["facts"]["device"] == device_name(cuda)
    assert "lpips" in json.dumps(told["figures"])
