"""Distances to the person's border."""

import numpy as np
import pytest

from ico3d.capture.posing.seeing.outlines import Outlines
from ico3d.common.camera import Camera


def outlines_of(mask: np.ndarray) -> Outlines:
    height, width = mask.shape
    camera = Camera(width, height, np.diag([100.0, 100.0, 1.0]), np.eye(4))
    found = Outlines.empty(1, [camera])
    found.add(0, 0, mask)
    return found


@pytest.mark.parametrize("border", [10.0, 10.25, 10.5, 10.75])
def test_a_straight_border_is_known_to_parts_of_a_pixel(border):
    columns = np.clip(border - np.arange(20), 0, 1)  # how much of each column is the person
    found = outlines_of(np.tile(columns, (16, 1)))
    pixels = np.array([[6.0, 8.0], [9.5, 8.0], [12.0, 8.0], [14.5, 8.0]])
    inside, slope = found.at(0, 0, pixels)
    np.testing.assert_allclose(inside, border - pixels[:, 0], atol=0.07)
    np.testing.assert_allclose(slope[[0, 3]], [[-1, 0], [-1, 0]], atol=0.07)


def test_beyond_the_picture_nothing_is_known():
    inside, _ = outlines_of(np.eye(12)).at(0, 0, np.array([[-3.0, 5.0], [5.0, 40.0], [6.0, 6.0]]))
    assert np.isnan(inside[:2]).all() and np.isfinite(inside[2])


def test_an_empty_mask_is_none():
    assert not outlines_of(np.zeros((8, 8))).known.any()


def test_a_person_who_fills_the_picture_has_no_border():
    inside, slope = outlines_of(np.ones((12, 12))).at(0, 0, np.array([[3.0, 4.0]]))
    assert inside[0] > 5 and not slope.any()
