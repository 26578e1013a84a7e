"""Files of all kinds that are given instead of a good video."""

import io
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image

from ico3d.avatar.film.video import write_video
from ico3d.capture.capture import Sound
from ico3d.creating.looking import samples
from ico3d.creating.looking.examine import examine, refuse_photograph
from ico3d.errors import CaptureError
from support.needs import needs

pytestmark = needs("av")

SIDE = 64


class Nobody:
    """Finds no face in any picture."""

    def faces(self, picture):
        assert picture.shape == (SIDE, SIDE, 3)
        return []


@pytest.fixture(autouse=True)
def empty_pictures(monkeypatch):
    @contextmanager
    def readers():
        yield Nobody(), None

    monkeypatch.setattr(samples, "_readers", readers)


def _video(path, frames: int, fps: float = 25.0, level: int = 120, sound: bool = True):
    pictures = (np.full((SIDE, SIDE, 3), level + i % 2, np.uint8) for i in range(frames))
    tone = 0.2 * np.sin(np.arange(16_000 * max(frames, 25) // 25) / 9).astype(np.float32)
    write_video(path, pictures, (SIDE, SIDE), fps, Sound(tone, 16_000) if sound else None)
    return path


def _examined(path):
    shares = []
    found = examine(path, 512, shares.append)
    assert shares == sorted(shares) and shares[-1] == 1
    return found


def test_a_photograph_is_refused_and_told_why(tmp_path):
    Image.fromarray(np.zeros((8, 8, 3), np.uint8)).save(tmp_path / "me.jpg")
    with pytest.raises(CaptureError, match=r"me\.jpg is a photograph: one picture shows neither"):
        examine(tmp_path / "me.jpg", 512, lambda _: None)
    with pytest.raises(CaptureError, match="is a photograph"):
        examine(_video(tmp_path / "one.mp4", 1), 512, lambda _: None)


@pytest.mark.parametrize("kind", ["PNG", "GIF", "BMP", "TIFF", "WEBP", "MPO", "JPEG"])
def test_every_kind_of_photograph_is_told_by_how_it_begins(tmp_path, kind):
    """To open a TIFF of 67 MB took 3.5 GB: what is beside its pixels is read at once."""
    made = io.BytesIO()
    Image.fromarray(np.zeros((8, 8, 3), np.uint8)).save(made, kind)
    (tmp_path / "me").write_bytes(made.getvalue()[:16])
    with pytest.raises(CaptureError, match="is a photograph"):
        refuse_photograph(tmp_path / "me")


@pytest.mark.parametrize(
    "content", [b"", b"RIFF\0\0\0\0AVI LIST", b"\0\0\0\x20ftypisom", b"BM is no picture"]
)
def test_other_files_are_none(tmp_path, content):
    (tmp_path / "a").write_bytes(content)
    refuse_photograph(tmp_path / "a")


def test_what_is_no_video_is_one_sentence(tmp_path):
    (tmp_path / "me.mp4").write_text("not at all")
    with pytest.raises(CaptureError, match=r"me\.mp4: the file cannot be decoded as a video"):
        examine(tmp_path / "me.mp4", 512, lambda _: None)
    with pytest.raises(CaptureError, match="there is no video file"):
        examine(tmp_path / "nothing.mp4", 512, lambda _: None)


def test_a_video_of_nobody_in_the_dark(tmp_path):
    found = _examined(_video(tmp_path / "dark.mp4", 100, level=9))
    assert found.seconds == pytest.approx(3.96) and found.rate == pytest.approx(25)
    (refused,) = found.refused
    assert refused.topic == "face" and "turn on the light" in refused.text
    assert [one.topic for one in found.advice if one.level == "better"] == ["length", "sound"]


def test_a_short_slow_silent_video_is_told_all_of_it(tmp_path):
    found = _examined(_video(tmp_path / "short.mp4", 20, fps=10.0, sound=False))
    assert [one.topic for one in found.refused] == ["length", "face", "sound"]
    assert [one.topic for one in found.advice if one.level == "better"] == ["rate"]
