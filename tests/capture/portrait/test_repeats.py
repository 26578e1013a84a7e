"""Moments of which a video has no picture of its own are not read."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from ico3d.capture.face.mediapipe_face import Face
from ico3d.capture.portrait import readings
from ico3d.capture.portrait.readings import MOST_REPEATED, is_repeated, read_faces
from ico3d.capture.writing import new_folder
from ico3d.errors import StorageError


def _picture(place: float, noise: int = 0) -> np.ndarray:
    """(96, 96, 3) uint8: a bright square at a place, and traces of compression."""
    picture = np.full((96, 96, 3), 60, np.uint8)
    picture[40:60, round(place) : round(place) + 20] = 200
    random = np.random.default_rng(noise)
    return picture + random.integers(0, 6, picture.shape, dtype=np.uint8) * (noise > 0)


def test_what_moved_is_another_picture():
    assert is_repeated(_picture(20), _picture(20))
    assert is_repeated(_picture(20, noise=1), _picture(20, noise=2))
    assert not is_repeated(_picture(20), _picture(22))
    assert not is_repeated(_picture(20), _picture(20) + np.uint8(9))  # the light changed


class _Reader:
    """Finds the same face in every picture."""

    names = ("jawOpen",)

    def __init__(self, model):
        del model

    def __enter__(self):
        return self

    def __exit__(self, *reason):
        pass

    def read(self, image):
        del image
        return Face(np.zeros((478, 2)), np.zeros(1), np.eye(4))


class _Video:
    """Pictures, and whether each was taken at its moment."""

    path, announced, rate = Path("v.mp4"), 0, 0.0

    def __init__(self, told):
        self._told = told

    def sampled(self, fps):
        assert fps == 25.0
        return iter(self._told)


@pytest.fixture
def read(tmp_path, monkeypatch):
    monkeypatch.setattr(readings, "FaceReader", _Reader)
    monkeypatch.setattr(readings, "save_landmarks", lambda *given: None)
    return lambda told: read_faces(tmp_path, _Video(told), tmp_path, Console(quiet=True), None)


def test_repeated_pictures_and_gaps_are_left_out(read, tmp_path):
    told = [
        (_picture(0), True),
        (_picture(0, noise=1), True),  # recorded again
        (_picture(5), True),
        (_picture(5), False),  # stands in for a moment without a picture
        (_picture(10), True),
    ]
    found = read(told)
    assert (found.frames, found.repeated, found.total) == ([0, 2, 4], [1, 3], 5)
    assert sorted(f.name for f in (tmp_path / "ori_imgs").iterdir()) == ["0.jpg", "2.jpg", "4.jpg"]


def test_who_sits_still_is_seen(read):
    found = read([(_picture(0, noise=n + 1), True) for n in range(9)])
    assert found.frames == list(range(0, 9, MOST_REPEATED + 1))


def test_pictures_without_a_face_are_not_kept(read, tmp_path, monkeypatch):
    """Of an hour of noise behind a second with a face, every picture was."""
    face = _Reader.read
    monkeypatch.setattr(
        _Reader, "read", lambda self, image: face(self, image) if image[50, 10, 0] > 100 else None
    )
    found = read([(_picture(place), True) for place in (0, 30, 60, 5)])
    assert (found.frames, found.missing) == ([0, 3], [1, 2])
    assert sorted(f.name for f in (tmp_path / "ori_imgs").iterdir()) == ["0.jpg", "3.jpg"]


def test_a_disk_is_not_filled(read, tmp_path, monkeypatch):
    left = iter([new_folder.SPARE + 1, new_folder.SPARE, new_folder.SPARE - 1])
    monkeypatch.setattr(new_folder.shutil, "disk_usage", lambda _: SimpleNamespace(free=next(left)))
    with pytest.raises(StorageError, match="the disk is full: free some space"):
        read([(_picture(place), True) for place in (0, 30, 60, 5)])
    assert sorted(f.name for f in (tmp_path / "ori_imgs").iterdir()) == ["0.jpg", "1.jpg"]
