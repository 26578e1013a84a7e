"""What is measured is drawn where the model is, and says so."""

import copy
import json

import numpy as np
import pytest
import torch

from ico3d.body.training.train_clip import train_body
from ico3d.cli import main
from ico3d.measure.body import evaluate_body
from ico3d.measure.head import evaluate_head
from ico3d.measure.pictures import lpips as room
from ico3d.measure.pictures.ms_ssim import ms_ssim
from ico3d.measure.scene import evaluate_scene
from ico3d.measure.sync import detectors
from ico3d.measure.sync.mfcc import mfcc
from ico3d.measure.sync.network import SyncNet
from ico3d.measure.sync.pipeline import lip_features, sound_features
from ico3d.measure.sync.s3fd import S3fd
from ico3d.splat.device import device_name
from support.bodies.moving_capture import MovingCapture
from support.bodies.tiny_training import job
from support.captures import open_with
from support.heads.offset_head import OffsetHead, offset_head
from support.pretended_cuda import drawn
from support.scenes.offset_scene import OffsetScene, offset_scene
from support.weights.sync import made_up, made_up_faces, made_up_sound

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


def test_ms_ssim_looks_there(cuda):
    a, b = np.random.default_rng(1).random((2, 180, 180, 3)).astype(np.float32)
    assert ms_ssim(a, b, cuda) == pytest.approx(ms_ssim(a, b), rel=1e-5)


def test_syncnet_looks_and_listens_there(cuda):
    network = SyncNet()
    network.load_state_dict(made_up(network, 1))
    faces, sound = made_up_faces(6), mfcc(made_up_sound(8 / 25))

    def features():
        return lip_features(network, faces), sound_features(network, sound, 1)

    here, there = features(), (network.to(cuda), features())[1]
    for ours, theirs in zip(there, here, strict=True):
        assert torch.allclose(ours, theirs, rtol=1e-3, atol=1e-5)


def test_the_finder_of_its_faces_looks_there(cuda, monkeypatch):
    monkeypatch.setattr(detectors, "load_s3fd", S3fd)  # of random weights
    finder = detectors.S3fdDetector(cuda)
    assert finder.boxes(np.zeros((400, 400, 3), np.uint8)).shape[1] == 4


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
