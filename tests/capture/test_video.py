"""Damaged films, as `bench/fuzz` found them: read, or one sentence."""

import pytest

from ico3d.capture.multiview.clip import Clip
from ico3d.capture.video import open_video, read_sound
from ico3d.errors import CaptureError
from support.recordings.films import write_film


def damaged(path, now, *marks):
    """A film in which some marks of four letters are another."""
    write_film(path)
    data = path.read_bytes()
    for mark in marks:
        assert mark in data
        data = data.replace(mark, now)
    path.write_bytes(data)
    return path


def test_pictures_of_an_unknown_kind_are_told(tmp_path):
    film = damaged(tmp_path / "a.mp4", b"what", b"avc1")
    with pytest.raises(CaptureError, match=r"cannot be decoded here\.$"):
        open_video(film, 48)
    with pytest.raises(CaptureError, match=r"can be decoded here\.$"):
        _ = Clip(film).count


def test_sound_of_an_unknown_kind_is_none(tmp_path):
    film = damaged(tmp_path / "a.mp4", b"what", b"mp4a", b"esds")
    assert read_sound(film) is None
    assert len(list(open_video(film, 48).frames(25.0))) == 10


def test_remarks_in_another_encoding_do_not_matter(tmp_path):
    film = damaged(tmp_path / "a.mp4", b"\xff\xfeav", b"Lavf")
    assert len(list(open_video(film, 48).frames(25.0))) == 10
    assert Clip(film).count == 10
