"""From pictures and sound to scores: rates, sound that belongs to the face, what is missing."""

import logging

import numpy as np
import pytest
import torch
from PIL import Image

from ico3d.capture.capture import Sound
from ico3d.errors import CaptureError, ModelError
from ico3d.measure.sync import pipeline as room
from ico3d.measure.sync import tracks
from ico3d.measure.sync.mfcc import mfcc
from ico3d.measure.sync.network import SyncNet
from ico3d.measure.sync.score import scores_of
from ico3d.measure.sync.tracks import Crops, Track
from support.weights.sync import made_up, made_up_faces, made_up_sound

pytestmark = pytest.mark.slow

BOX = np.array([60.0, 40.0, 165.0, 150.0])


class Everywhere:
    """Finds a face in the same place of every picture but the first two."""

    name = "s3fd"

    def __init__(self):
        self.seen = 0

    def __enter__(self):
        return self

    def __exit__(self, *details):
        pass

    def boxes(self, picture):
        assert picture.dtype == np.uint8 and picture.flags.c_contiguous
        self.seen += 1
        return BOX[None] if self.seen > 2 else np.zeros((0, 4))


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """A folder with made-up weights of SyncNet in the public format."""
    folder = tmp_path_factory.mktemp("weights")
    torch.save(made_up(SyncNet(), 1), folder / "syncnet_v2.model")
    return folder


@pytest.fixture(scope="module")
def network(weights):
    """SyncNet with these weights."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ICO3D_MODELS", str(weights))
        return room.load_syncnet()


@pytest.fixture
def only(weights, tmp_path, monkeypatch):
    """No weights but SyncNet's."""
    monkeypatch.setenv("ICO3D_MODELS", str(weights))
    monkeypatch.setenv("HOME", str(tmp_path))


def test_the_face_is_compared_with_the_sound_of_its_own_frames(only, network, monkeypatch):
    monkeypatch.setattr(room, "load_syncnet", lambda: network)
    monkeypatch.setattr(tracks, "MORE_THAN", 8)
    monkeypatch.setattr(room, "detector_on", lambda device: Everywhere())
    faces, samples = made_up_faces(15), made_up_sound(8 / 25)
    sound = Sound(samples.astype(np.float32) / 32768, 16_000)
    found = room.sync_scores(iter(faces.astype(np.float32) / 255), 25.0, sound)
    crops = Crops(Track(2, np.tile(BOX, (13, 1))))
    cut = [crops.cut(faces[k + 2], k) for k in range(5)]
    heard = room.sound_features(network, mfcc(samples[2 * 640 :]), 1)
    expected = scores_of(room.lip_features(network, cut), heard, 13, "s3fd")
    # the pictures waited as JPEG
    assert found.distance == pytest.approx(expected.distance, rel=0.01)
    assert (found.frames, found.detector) == (13, "s3fd")


def test_features_are_those_of_an_independent_implementation_in_batches_too(network, monkeypatch):
    # of the class S of the package syncnet-python 0.2.3, with the same weights
    expected = [-2.1327231, 9.2391176, -0.9261863, -2.6858404]
    monkeypatch.setattr(room, "BATCH", 1)
    lips = room.lip_features(network, made_up_faces(12)[:6])
    assert lips.shape == (2, 1024)
    np.testing.assert_allclose(lips[0, [0, 1, 500, 1023]], expected, atol=1e-4)
    monkeypatch.setattr(room, "BATCH", 2)
    torch.testing.assert_close(
        room.lip_features(network, made_up_faces(12)[:6]), lips, rtol=1e-4, atol=1e-4
    )
    sound = room.sound_features(network, mfcc(made_up_sound(0.48)), 3)
    expected = [-3.4816737, 0.6973919, -0.2391962, -2.1936059]
    np.testing.assert_allclose(sound[1, [0, 1, 500, 1023]], expected, atol=1e-4)


@pytest.mark.parametrize(
    ("fps", "expected"),
    [(25, [0, 1, 2, 3, 4, 5]), (50, [0, 2, 4]), (12.5, [0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5])],
)
def test_pictures_come_at_25_per_second(fps, expected):
    frames = [np.array([k]) for k in range(6)]
    assert [int(frame[0]) for frame in room.at_rate(frames, fps)] == expected


def test_without_weights_a_warning_says_what_to_fetch(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    with caplog.at_level(logging.WARNING):
        assert room.sync_or_none([], 25, Sound(np.zeros(9, np.float32), 16_000)) is None
    assert "ico3d weights fetch syncnet" in caplog.text


def test_without_any_detector_it_says_how_to_get_the_published_one(only, caplog):
    with caplog.at_level(logging.WARNING):
        assert room.sync_or_none([], 25, Sound(np.zeros(9, np.float32), 16_000)) is None
    assert "ico3d weights fetch s3fd" in caplog.text


def test_pictures_without_a_face_are_one_sentence(network, monkeypatch):
    monkeypatch.setattr(room, "load_syncnet", lambda: network)
    monkeypatch.setattr(room, "detector_on", lambda device: Everywhere())
    sound = Sound(np.zeros(16_000, np.float32), 16_000)
    with pytest.raises(CaptureError, match=r"no face .* \(1 of 3 show one\)"):
        room.sync_scores(made_up_faces(3), 25, sound)


def test_a_file_of_something_else_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    torch.save({"netfcaud.0.weight": torch.zeros(3)}, tmp_path / "syncnet_v2.model")
    with pytest.raises(ModelError, match="does not hold the weights of SyncNet"):
        room.load_syncnet()


def test_a_video_without_sound_is_one_sentence(tmp_path):
    Image.new("RGB", (8, 8)).save(tmp_path / "mute.gif")
    with pytest.raises(CaptureError, match=r"mute.gif has no sound"):
        room.sync_of_video(tmp_path / "mute.gif")
