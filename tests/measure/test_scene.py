"""Evaluation of a scene against a capture whose pictures differ from it by a known error."""

import json

import numpy as np
import pytest
import torch

from ico3d.errors import CaptureError
from ico3d.measure.commands import Evaluate
from ico3d.measure.scene import evaluate_scene
from ico3d.splat.render import render
from support.captures import open_with
from support.scenes.offset_scene import OffsetScene, offset_scene


def _scores(tmp_path, only, plate=None, **arguments):
    trained = offset_scene(only)
    capture = OffsetScene(tmp_path, trained, plate)
    return capture, evaluate_scene(trained, capture, "test", arguments.get("images"))


def test_metrics_are_those_of_the_pictures(tmp_path):
    capture, scores = _scores(tmp_path, "all")
    errors = {"psnr": [], "psnr_mask": [], "psnr_background": []}
    for camera in (0, 8):
        with torch.no_grad():
            gaussians = offset_scene("all").scene.gaussians()
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
    trained = offset_scene("all")
    capture = OffsetScene(tmp_path, trained, cameras=3)
    with pytest.raises(CaptureError, match="has no test pictures"):
        evaluate_scene(trained, capture, "test", None)
    assert evaluate_scene(trained, capture, "all", None)["psnr"] is not None


def test_the_verb_recognises_a_scene_and_writes_pictures(tmp_path, monkeypatch):
    trained = offset_scene("all")
    trained.save(tmp_path / "model")
    open_with(monkeypatch, lambda _: OffsetScene(tmp_path, trained))
    out = tmp_path / "out"
    Evaluate(tmp_path / "model", tmp_path, out / "metrics.json", out / "images").run()
    assert json.loads((out / "metrics.json").read_text())["num_gaussians"] == 60
    written = sorted(str(p.relative_to(out / "images")) for p in (out / "images").rglob("*.png"))
    assert written == [
        f"{part}/{c}/000000.png" for part in ("gt", "mask", "pred") for c in ("c0", "c8")
    ]
