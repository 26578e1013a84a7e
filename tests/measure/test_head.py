"""Evaluation of a head against a capture whose pictures differ from it by a known error."""

import json
import logging
from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image

from ico3d.capture.capture import Sound
from ico3d.capture.face.landmarks import MULTI_PIE
from ico3d.capture.face.mediapipe_face import Face
from ico3d.common.camera import look_at
from ico3d.errors import CaptureError
from ico3d.head.views import view_of
from ico3d.measure.head import evaluate_head, most_frontal_camera
from ico3d.measure.part_metrics import mouth_box
from ico3d.measure.sync.score import SyncScores
from ico3d.splat.render import render
from support.heads.offset_head import ERROR, SIZE, OffsetHead, offset_head


class BeforeCurtain(OffsetHead):
    """The person, lighter by `ERROR`, before a curtain that no clean plate shows."""

    def background(self, camera):
        return None

    def _rendered(self, camera, frame):
        weights = self.blendshapes(frame)
        with torch.no_grad():
            gaussians = self._head.model(torch.tensor([weights[2], weights[0]]))
            return render(gaussians, [view_of(self, camera, frame).camera], torch.full((3,), 0.5))

    def mask(self, camera, frame):
        return (self._rendered(camera, frame).alpha[0] > 0).float().numpy()

    def image(self, camera, frame):
        person = self.mask(camera, frame)[..., None]
        curtain = np.array([0.9, 0.1, 0.0], np.float32)
        return (
            person * (self._rendered(camera, frame).rgb[0].numpy() + ERROR) + (1 - person) * curtain
        )

    def landmarks(self, camera, frame):
        return None


class Reader:
    """Sees a mouth in every picture that was recorded, and remembers which."""

    def __init__(self):
        self.seen = []

    def __enter__(self):
        return self

    def __exit__(self, *details):
        pass

    names = ("jawOpen",)
    rigidity = np.ones(468)

    def read(self, picture, mask=None):
        self.seen.append(picture)
        return OffsetHead.landmarks(None, 0, 0)

    def face(self, picture, mask=None):
        """A mouth as `OffsetHead` has it, 3 pixels further to the right; it opens with time."""
        points = np.zeros((478, 2))
        points[MULTI_PIE] = OffsetHead.landmarks(None, 0, 0) + np.array([3, 0])
        return Face(points, np.array([0.1 * (len(self.seen) % 2)]), np.eye(4), np.zeros(478))


@pytest.fixture
def no_models(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))


def test_metrics_of_a_known_error(tmp_path, no_models, caplog):
    head = offset_head()
    with caplog.at_level(logging.WARNING):
        scores = evaluate_head(head, OffsetHead(tmp_path, head), (3, 4, 5), None)
    for key in ("psnr", "psnr_mask", "psnr_mouth"):
        assert scores[key] == pytest.approx(20.0, abs=1e-3)
    assert 0 < scores["ssim"] < 1
    assert scores["temporal_flicker"] == pytest.approx(0, abs=1e-6)  # the error stays the same
    assert [scores[key] for key in ("ms_ssim", "lpips", "lpips_alex")] == [None] * 3
    assert scores["num_gaussians"] == 40
    assert scores["train_seconds"] == 7.0
    assert scores["ms_per_frame"] > 0
    unseen = ("lmd", "lip_correlation", "lip_lag_ms", "identity_distance", "sync_c", "sync_offset")
    assert [scores[key] for key in unseen] == [None] * 6
    assert "lips are not measured" in caplog.text
    assert "has no sound: lip synchronisation is not measured" in caplog.text
    json.dumps(scores, allow_nan=False)


def test_without_a_clean_plate_the_curtain_is_not_compared(tmp_path, no_models):
    head = offset_head(0.4)
    capture = BeforeCurtain(tmp_path, head)
    scores = evaluate_head(head, capture, (3, 4, 5), tmp_path / "images")
    share = np.mean([capture.mask(c, f).mean() for f in (3, 4, 5) for c in (0, 1)])
    assert 0.05 < share < 0.9
    assert scores["psnr_mask"] == pytest.approx(20.0, abs=1e-3)
    # over one grey in both pictures: nothing but the person differs
    assert scores["psnr"] == pytest.approx(20 - 10 * np.log10(share), abs=0.5)
    truth = np.asarray(Image.open(tmp_path / "images" / "gt" / "front" / "000003.png"))
    assert (truth[capture.mask(1, 3) == 0] == 128).all()


def test_a_mouth_without_landmarks_is_found_in_the_recorded_picture(tmp_path, monkeypatch):
    head, reader = offset_head(0.4), Reader()
    monkeypatch.setattr("ico3d.measure.head.landmark_reader", lambda: reader)
    capture = BeforeCurtain(tmp_path, head)
    scores = evaluate_head(head, capture, (3, 4, 5), None)
    box = mouth_box(OffsetHead.landmarks(None, 0, 0), SIZE, SIZE)
    shares = [capture.mask(c, f)[box].mean() for f in (3, 4, 5) for c in (0, 1)]
    expected = np.mean([20 - 10 * np.log10(share) for share in shares])
    assert scores["psnr_mouth"] == pytest.approx(expected, abs=1e-3)
    np.testing.assert_array_equal(reader.seen[0], capture.image(0, 3))
    assert scores["lmd"] == pytest.approx(0, abs=1e-9)
    assert scores["blendshape_error_lower"] == scores["blendshape_error_upper"] == 0
    assert scores["identity_distance"] == pytest.approx(0, abs=1e-6)


def test_cameras_that_see_no_face_are_not_asked_for_one(tmp_path, monkeypatch, caplog):
    head, reader = offset_head(0.4), Reader()
    monkeypatch.setattr("ico3d.measure.head.landmark_reader", lambda: reader)
    capture = BeforeCurtain(tmp_path, head)
    behind = look_at(np.array([0.1, 0.0, -0.7]), np.zeros(3))
    capture.cameras = tuple(replace(c, world_to_camera=behind) for c in capture.cameras)
    reader.read = reader.face = lambda picture, mask=None: None
    scores = evaluate_head(head, capture, (3, 4, 5), None)
    assert scores["psnr_mouth"] is None and reader.seen == []
    (told,) = [record for record in caplog.records if "not measured: " in record.getMessage()]
    lacking = "psnr_mouth, lmd, lip_correlation, lip_lag_ms, blendshape_error_lower"
    assert lacking in told.getMessage() and "identity_drift" in told.getMessage()


def test_pictures_lie_where_anybody_can_score_them(tmp_path, no_models):
    head = offset_head()
    evaluate_head(head, OffsetHead(tmp_path, head), (3, 4, 5), tmp_path / "images")
    for part in ("pred", "gt", "mask"):
        names = sorted(str(p.relative_to(tmp_path / "images" / part)) for p in
                       (tmp_path / "images" / part).rglob("*.png"))  # fmt: skip
        sides = [f"side/00000{frame}.png" for frame in (3, 5)]
        assert names == [f"front/00000{frame}.png" for frame in (3, 4, 5)] + sides
    mask = np.asarray(Image.open(tmp_path / "images" / "mask" / "front" / "000003.png"))
    np.testing.assert_array_equal(mask, np.eye(SIZE) * 255)


def test_the_frontal_camera_faces_the_head(tmp_path):
    assert most_frontal_camera(OffsetHead(tmp_path, offset_head()), (0, 1)) == 1


def test_a_capture_of_another_face_is_one_sentence(tmp_path, no_models):
    head = offset_head()
    capture = OffsetHead(tmp_path, head)
    capture.blendshape_names = ("b", "extra", "c")
    with pytest.raises(CaptureError, match="has no blendshape 'a'"):
        evaluate_head(head, capture, (3,), None)


def test_lips_are_compared_with_the_sound_of_the_same_frames(tmp_path, no_models, monkeypatch):
    class Speaking(OffsetHead):
        def audio(self):
            return Sound(np.arange(16_000, dtype=np.float32), 16_000)

    def scores(frames, fps, sound, device):
        assert [frame.shape for frame in frames] == [(SIZE, SIZE, 3)] * 3
        assert (fps, str(device), sound.rate) == (25.0, "cpu", 16_000)
        assert sound.samples[0] == 3 * 640  # the first of the frames is number 3
        return SyncScores(5.5, 8.25, -2, 3, "s3fd")

    monkeypatch.setattr("ico3d.measure.head.sync_or_none", scores)
    head = offset_head()
    found = evaluate_head(head, Speaking(tmp_path, head), (3, 4, 5), None)
    keys = ("sync_c", "sync_d", "sync_offset", "sync_faces_by")
    assert [found[key] for key in keys] == [5.5, 8.25, -2, "s3fd"]
