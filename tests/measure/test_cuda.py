"""What is measured is drawn where the model is, and says so."""

import copy
import json

import numpy as np
import pytest

from ico3d.body.training.train_clip import train_body
from ico3d.cli import main
from ico3d.measure.body import evaluate_body
from ico3d.measure.head import evaluate_head
from ico3d.measure.pictures import lpips as room
from ico3d.measure.scene import evaluate_scene
from ico3d.splat.device import device_name
from support.bodies.moving_capture import MovingCapture
from support.bodies.tiny_training import job
from support.captures import open_with
from support.heads.offset_head import OffsetHead, offset_head
from support.pretended_cuda import drawn
from support.scenes.offset_scene import OffsetScene, offset_scene

pytestmark = pytest.mark.slow


def _same(found: dict, wanted: dict) -> None:
    """What was measured on either device, but for how long it took."""
    assert found.keys() == wanted.keys()
    for name in wanted.keys() - {"ms_per_frame", "fps", "device"}:
        if isinstance(wanted[name], float):
            assert found[name] == pytest.approx(wanted[name], rel=1e-3, abs=1e-6), name


@pytest.fixture
def no_models(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))


def test_a_head(cuda, no_models, tmp_path):
    head = offset_head()
    capture = OffsetHead(tmp_path, copy.deepcopy(head))
    here = evaluate_head(head, capture, (3, 4, 5), None)
    head.model.to(cuda)
    there = evaluate_head(head, capture, (3, 4, 5), tmp_path / "pictures")
    _same(there, here)
    assert (here["device"], there["device"]) == ("cpu", device_name(cuda))


def test_a_body(cuda, no_models, tmp_path):
    capture = MovingCapture(tmp_path / "capture")
    body = train_body(capture, tmp_path / "body", job("spacetime"))  # loaded: on the CPU
    here = evaluate_body(body, capture, frames=(0, 3))
    for model in body.models:
        model.to(cuda)
    there = evaluate_body(body, capture, frames=(0, 3), images=tmp_path / "pictures")
    _same(there, here)
    assert (here["device"], there["device"]) == ("cpu", device_name(cuda))


@pytest.mark.parametrize("only", ["all", "person"])
def test_a_scene(cuda, tmp_path, only):
    scene = offset_scene(only)
    capture = OffsetScene(tmp_path, copy.deepcopy(scene), plate=0.5)
    here = evaluate_scene(scene, capture, "test", None)
    scene.scene.to(cuda)
    there = evaluate_scene(scene, capture, "test", tmp_path / "pictures")
    _same(there, here)
    assert (here["device"], there["device"]) == ("cpu", device_name(cuda))


def test_lpips_looks_there(cuda, lpips_weights, look_again, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(lpips_weights[0]))
    a, b = np.random.default_rng(1).random((2, 32, 40, 3)).astype(np.float32)
    assert room.lpips(a, b, "vgg", cuda) == pytest.approx(room.lpips(a, b), rel=1e-5)


@pytest.mark.parametrize("device", ["auto", "cuda", "cpu"])
def test_the_verb(cuda, no_models, tmp_path, monkeypatch, device):
    head = offset_head()
    (tmp_path / "head").mkdir()
    head.save(tmp_path / "head")
    open_with(monkeypatch, lambda path: OffsetHead(tmp_path, copy.deepcopy(head)))
    words = ["evaluate", tmp_path / "head", "capture", "--json", tmp_path / "a.json"]
    with drawn(monkeypatch) as pictures:
        assert main([*map(str, words), "--device", device]) == 0
    assert (len(pictures) > 0) == (device != "cpu")
    figures = json.loads((tmp_path / "a.json").read_text())
    assert figures["device"] == ("cpu" if device == "cpu" else device_name(cuda))
