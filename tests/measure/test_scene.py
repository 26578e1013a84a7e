"""Evaluation of a scene against a capture whose pictures differ from it by a known error."""

import json

import numpy as np
import pytest
import torch

from ico3d.capture.capture import Capture, Split
from ico3d.common.camera import Camera, look_at
from ico3d.errors import CaptureError
from ico3d.measure.commands import Evaluate
from ico3d.measure.scene import evaluate_scene
from ico3d.scene.model import scene_on_points
from ico3d.scene.model_folder import TrainedScene
from ico3d.splat.render import render
from support.captures import open_with

SIZE = 32


def _trained(only) -> TrainedScene:
    rng = np.random.default_rng(0)
    scene = scene_on_points(rng.normal(size=(60, 3)) * 0.1, rng.random((60, 3)), 1, 0.8, 1.0)
    return TrainedScene(scene, only, "all", "world", {"train_seconds": 7.0})


class Offset(Capture):
    """What the scene renders; lighter by 0.1 where the person is, by 0.01 elsewhere."""

    kind, fps, num_frames, split = "offset", 25.0, 1, Split((), (0,))

    def __init__(self, path, trained, plate=None, cameras=9):
        self.path, self._trained, self._plate = path, trained, plate
        intrinsics = np.array([[50.0, 0, SIZE / 2], [0, 50.0, SIZE / 2], [0, 0, 1]])
        self.cameras = tuple(
            Camera(SIZE, SIZE, intrinsics, look_at([x, 0, 0.8], np.zeros(3)), f"c{n}")
            for n, x in enumerate(np.linspace(-0.3, 0.3, cameras))
        )

    def image(self, camera, frame):
        behind = None if self._plate is None else torch.full((3,), self._plate)
        with torch.no_grad():
            gaussians = self._trained.scene.gaussians()
            picture = render(gaussians, [self.cameras[camera]], behind).rgb[0]
        return np.clip(picture.numpy() * 0.8, 0, 0.8) + self._error()[..., None]

    def background(self, camera):
        if self._plate is None:
            return None
        return np.full((SIZE, SIZE, 3), self._plate, np.float32)

    def mask(self, camera, frame):
        mask = np.zeros((SIZE, SIZE), np.float32)
        mask[:, :8] = 1
        return mask

    def _error(self):
        return np.where(self.mask(0, 0) > 0, 0.1, 0.01).astype(np.float32)


def _scores(tmp_path, only, plate=None, **arguments):
    trained = _trained(only)
    capture = Offset(tmp_path, trained, plate)
    return capture, evaluate_scene(trained, capture, "test", arguments.get("images"))


def test_metrics_are_those_of_the_pictures(tmp_path):
    capture, scores = _scores(tmp_path, "all")
    errors = {"psnr": [], "psnr_mask": [], "psnr_background": []}
    for camera in (0, 8):
        with torch.no_grad():
            gaussians = _trained("all").scene.gaussians()
            predicted = render(gaussians, [capture.cameras[camera]]).rgb[0].clamp(0, 1).numpy()
        truth = np.round(capture.image(camera, 0) * 255) / 255
        squares = ((predicted - truth) ** 2).mean(-1)
        mask = capture.mask(camera, 0) > 0
        errors["psnr"].append(squares.mean())
        errors["psnr_mask"].append(squares[mask].mean())
        errors["psnr_background"].append(squares[~mask].mean())
    for key, values in errors.items():
        assert scores[key] == pytest.approx(np.mean(-10 * np.log10(values)), abs=1e-3)
    assert 0 < scores["ssim"] < 1 and scores["num_gaussians"] == 60
    assert scores["train_seconds"] == 7.0 and scores["ms_per_frame"] > 0
    json.dumps(scores, allow_nan=False)


def test_what_cannot_be_known_is_not_measured(tmp_path):
    known = {"psnr", "ssim", "psnr_mask", "psnr_background"}
    cases = {
        ("person", None): {"psnr_mask"},
        ("person", 0.5): {"psnr", "ssim", "psnr_mask"},
        ("background", None): {"psnr_background"},
        ("background", 0.5): {"psnr", "ssim", "psnr_background"},
    }
    for (only, plate), measured in cases.items():
        _, scores = _scores(tmp_path, only, plate)
        assert {key for key in known if scores[key] is not None} == measured, (only, plate)


def test_without_test_pictures_it_says_so(tmp_path):
    trained = _trained("all")
    capture = Offset(tmp_path, trained, cameras=3)
    with pytest.raises(CaptureError, match="has no test pictures"):
        evaluate_scene(trained, capture, "test", None)
    assert evaluate_scene(trained, capture, "all", None)["psnr"] is not None


def test_the_verb_recognises_a_scene_and_writes_pictures(tmp_path, monkeypatch):
    trained = _trained("all")
    trained.save(tmp_path / "model")
    open_with(monkeypatch, lambda _: Offset(tmp_path, trained))
    out = tmp_path / "out"
    Evaluate(tmp_path / "model", tmp_path, out / "metrics.json", out / "images").run()
    assert json.loads((out / "metrics.json").read_text())["num_gaussians"] == 60
    written = sorted(str(p.relative_to(out / "images")) for p in (out / "images").rglob("*.png"))
    assert written == [
        f"{part}/{c}/000000.png" for part in ("gt", "mask", "pred") for c in ("c0", "c8")
    ]
