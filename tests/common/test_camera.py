"""The pinhole camera."""

import numpy as np

from ico3d.common.camera import Camera, look_at


def test_a_crop_sees_the_same_points_at_shifted_pixels():
    """Pixels move by what is cut off; depth stays."""
    whole = Camera(
        64, 48, np.array([[50.0, 0, 32], [0, 52, 24], [0, 0, 1]]), look_at((1, 2, 3), (0, 0, 0))
    )
    points = np.random.default_rng(0).normal(size=(20, 3))
    part = whole.cropped(10, -4, 30, 50)
    pixels, depths = whole.project(points)
    cut, cut_depths = part.project(points)
    assert (part.width, part.height) == (30, 50)
    np.testing.assert_allclose(cut, pixels - (10, -4), rtol=1e-12, atol=1e-9)
    np.testing.assert_array_equal(cut_depths, depths)
