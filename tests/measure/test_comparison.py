"""Folders and videos that anybody rendered, against closed forms."""

import numpy as np
import pytest
from PIL import Image

from ico3d.errors import CaptureError
from ico3d.measure.comparison import compare_faces, compare_pictures, paired, pictures_of


class Reader:
    """Sees no face, and remembers what it was shown."""

    names = ()
    rigidity = np.ones(468)

    def __init__(self):
        self.seen = []

    def face(self, picture):
        self.seen.append(float(picture.mean()))


def write(folder, values):
    """Flat pictures of 8 x 6 pixels, one for each value."""
    folder.mkdir()
    for number, value in enumerate(values):
        picture = np.full((6, 8, 3), value, np.uint8)
        Image.fromarray(picture).save(folder / f"{number:06d}.png")
    (folder / "notes.txt").write_text("no picture")
    return folder


@pytest.fixture
def no_models(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))


def test_folders_are_compared_picture_by_picture(tmp_path, no_models, look_again):
    ours = write(tmp_path / "ours", [51, 102, 153])
    truth = write(tmp_path / "truth", [0, 51, 51])
    masks = [np.eye(6, 8)] * 3
    found = compare_pictures(pictures_of(ours, 25), pictures_of(truth, 25), masks)
    expected = np.mean([-20 * np.log10(error) for error in (0.2, 0.2, 0.4)])
    assert found["psnr"] == found["psnr_mask"] == pytest.approx(expected)
    assert found["temporal_flicker"] == pytest.approx(0.1, abs=1e-6)
    assert found["lpips"] is None and found["ms_ssim"] is None
    plain = compare_pictures(pictures_of(ours, 25), pictures_of(truth, 25))
    assert plain["psnr_mask"] is None and plain["psnr"] == found["psnr"]


def test_a_video_is_read_at_the_rate_that_is_asked_for(tmp_path):
    shades = [Image.new("L", (16, 16), 40 * k) for k in range(4)]
    shades[0].save(tmp_path / "a.gif", save_all=True, append_images=shades[1:], duration=40)
    found = [picture.mean() * 255 / 40 for picture in pictures_of(tmp_path / "a.gif", 12.5)]
    np.testing.assert_allclose(found, [0, 2, 3], atol=0.2)  # the last lasts until 0.16 s


def test_faces_are_read_on_both_sides(tmp_path):
    reader = Reader()
    pictures = [np.full((4, 4, 3), value) for value in (0.1, 0.2)]
    found = compare_faces(pictures, pictures[::-1], 25, reader)
    assert reader.seen == pytest.approx([0.1, 0.2, 0.2, 0.1])
    assert set(found.values()) == {None}


def test_what_cannot_be_compared_is_one_sentence(tmp_path):
    one, two = np.zeros((4, 6, 3)), np.zeros((4, 8, 3))
    with pytest.raises(CaptureError, match="more recorded pictures than the 1 of the other"):
        list(paired([one], [one, one]))
    with pytest.raises(CaptureError, match="picture 0 is 6 x 4 rendered, but 8 x 4 recorded"):
        list(paired([one], [two]))
    with pytest.raises(CaptureError, match="no pictures to compare"):
        list(paired([], []))
    (tmp_path / "empty").mkdir()
    with pytest.raises(CaptureError, match="empty has no pictures"):
        list(pictures_of(tmp_path / "empty", 25))
    (tmp_path / "empty" / "a.png").write_bytes(b"\x89PNG broken")
    with pytest.raises(CaptureError, match=r"a\.png cannot be read as a picture"):
        list(pictures_of(tmp_path / "empty", 25))
