"""The mark that a machine made a film."""

import av
import numpy as np
import pytest

from ico3d.avatar.film.command import Render
from ico3d.avatar.film.mark import marked
from support.bodies.moving_capture import MovingCapture
from support.bodies.true_body import still_body


@pytest.mark.parametrize("grey", [0, 128, 255])
def test_the_mark_is_read_on_any_ground(grey):
    plain = np.full((480, 270, 3), grey, np.uint8)
    (shown,) = marked([plain], (270, 480))
    assert np.ptp(plain) == 0  # what was drawn is left alone
    changed = np.argwhere((shown != plain).any(axis=-1))
    (top, left), (bottom, right) = changed.min(axis=0), changed.max(axis=0)
    assert 0 < top < 20 and 0 < left < 20 and bottom < 60 and right < 60
    corner = shown[top : bottom + 1, left : right + 1].astype(int)
    assert corner.max() - corner.min() > 150  # white letters on a dark field


def test_all_pictures_have_it_and_the_rest_of_them_is_as_it_was():
    pictures = list(np.random.default_rng(0).integers(0, 256, (3, 200, 300, 3), np.uint8))
    for picture, shown in zip(pictures, marked(pictures, (300, 200)), strict=True):
        assert (shown[:30, :40] != picture[:30, :40]).any()
        assert (shown[60:] == picture[60:]).all() and (shown[:, 60:] == picture[:, 60:]).all()


def test_a_tiny_picture_has_a_part_of_it():
    (shown,) = marked([np.zeros((8, 8, 3), np.uint8)], (8, 8))
    assert shown.shape == (8, 8, 3) and shown.any()


def test_films_are_marked_unless_told_otherwise(tmp_path):
    still_body(MovingCapture(tmp_path), tmp_path / "body")
    first = {}
    for mark in (True, False):
        out = tmp_path / f"{mark}.mp4"
        Render(tmp_path / "body", out, size=(96, 128), seconds=0.1, ai_mark=mark).run()
        with av.open(str(out)) as film:
            first[mark] = next(film.decode(video=0)).to_ndarray(format="rgb24").astype(int)
    change = np.abs(first[True] - first[False]).max(axis=-1)
    assert change[:32, :32].max() > 100 and change[48:].max() < 30
