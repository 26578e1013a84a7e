"""Evaluation of a head against a capture whose pictures differ from it by a known error."""

import json
import logging

import numpy as np
import pytest
import torch
from PIL import Image

from ico3d.capture.capture import Capture, Split
from ico3d.common.camera import Camera, look_at
from ico3d.errors import CaptureError
from ico3d.head.model import HeadModel, HeadShape
from ico3d.head.trained import TrainedHead
from ico3d.head.views import view_of
from ico3d.measure.evaluate import evaluate_head, most_frontal_camera
from ico3d.splat.render import render

SIZE, ERROR = 32, 0.1


def _head() -> TrainedHead:
    torch.manual_seed(0)
    model = HeadModel(HeadShape(2, "no-mlp"), 40)
    model.means.data = 0.1 * torch.randn(40, 3)
    model.log_scales.data.fill_(-3)
    model.basis.data[:, :, :3] = torch.randn(3, 40, 3) - 1
    return TrainedHead(model, "blendshapes", ("a", "b"), "", "", None, {"train_seconds": 7.0})


class Offset(Capture):
    """What the head renders, everywhere lighter by `ERROR`."""

    kind = "offset"
    fps = 25.0
    num_frames = 6
    split = Split((0, 1, 2), (3, 4, 5))
    blendshape_names = ("b", "extra", "a")

    def __init__(self, path, head: TrainedHead):
        self.path, self._head = path, head
        intrinsics = np.array([[50.0, 0, SIZE / 2], [0, 50.0, SIZE / 2], [0, 0, 1]])
        eyes = ([0.6, 0.0, 0.3], [0.05, 0.0, 0.7])
        self.cameras = tuple(
            Camera(SIZE, SIZE, intrinsics, look_at(np.array(eye), np.zeros(3)), name)
            for eye, name in zip(eyes, ("side", "front"), strict=True)
        )

    def blendshapes(self, frame):
        return np.array([0.1 * frame, 9.0, 1 - 0.1 * frame], np.float32)

    def world_from_head(self, frame):
        return np.eye(4)

    def image(self, camera, frame):
        if frame == 4 and camera == 0:
            return None
        weights = self.blendshapes(frame)
        expression = torch.tensor([weights[2], weights[0]])
        with torch.no_grad():
            gaussians = self._head.model(expression)
            picture = render(gaussians, [view_of(self, camera, frame).camera]).rgb[0]
        return (picture + ERROR).numpy()

    def mask(self, camera, frame):
        return np.eye(SIZE, dtype=np.float32)

    def landmarks(self, camera, frame):
        return np.stack(np.meshgrid(np.arange(10, 22), np.arange(10, 16)), -1).reshape(-1, 2)[:68]


@pytest.fixture
def no_models(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))


def test_metrics_of_a_known_error(tmp_path, no_models, caplog):
    head = _head()
    with caplog.at_level(logging.WARNING):
        scores = evaluate_head(head, Offset(tmp_path, head), (3, 4, 5), None)
    for key in ("psnr", "psnr_mask", "psnr_mouth"):
        assert scores[key] == pytest.approx(20.0, abs=1e-3)
    assert 0 < scores["ssim"] < 1
    assert scores["num_gaussians"] == 40
    assert scores["train_seconds"] == 7.0
    assert scores["ms_per_frame"] > 0
    assert [scores[key] for key in ("lmd", "lip_correlation", "lip_lag_ms")] == [None] * 3
    assert "lips are not measured" in caplog.text
    json.dumps(scores, allow_nan=False)


def test_pictures_lie_where_anybody_can_score_them(tmp_path, no_models):
    head = _head()
    evaluate_head(head, Offset(tmp_path, head), (3, 4, 5), tmp_path / "images")
    for part in ("pred", "gt", "mask"):
        names = sorted(str(p.relative_to(tmp_path / "images" / part)) for p in
                       (tmp_path / "images" / part).rglob("*.png"))  # fmt: skip
        sides = [f"side/00000{frame}.png" for frame in (3, 5)]
        assert names == [f"front/00000{frame}.png" for frame in (3, 4, 5)] + sides
    mask = np.asarray(Image.open(tmp_path / "images" / "mask" / "front" / "000003.png"))
    np.testing.assert_array_equal(mask, np.eye(SIZE) * 255)


def test_the_frontal_camera_faces_the_head(tmp_path):
    assert most_frontal_camera(Offset(tmp_path, _head()), (0, 1)) == 1


def test_a_capture_of_another_face_is_one_sentence(tmp_path, no_models):
    head = _head()
    capture = Offset(tmp_path, head)
    capture.blendshape_names = ("b", "extra", "c")
    with pytest.raises(CaptureError, match="has no blendshape 'a'"):
        evaluate_head(head, capture, (3,), None)
