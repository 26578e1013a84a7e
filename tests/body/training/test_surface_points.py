"""Where the Gaussians of a window begin."""

import numpy as np
import pytest

from ico3d.body.training.surface_points import initial_points, point_colors
from ico3d.capture.surface.coverage import visible
from ico3d.errors import CaptureError
from support.bodies.moving_ball import AXES, BALL


def _start(capture, frame=0, count=3000):
    return initial_points(capture, frame, count, np.random.default_rng(0))


def _outside(points, center):
    """Metres that points (P, 3) lie outside of the trunk or ball, whichever is nearer; about."""
    trunk = (np.linalg.norm(points / AXES, axis=1) - 1) * AXES.min()
    ball = np.linalg.norm(points - center, axis=1) - BALL
    return np.minimum(trunk, ball)


def test_the_captures_own_points_come_first(moving_ball, monkeypatch):
    capture = moving_ball([0.0, 0.3])
    monkeypatch.setattr(
        type(capture),
        "world_points",
        lambda self, frame: np.concatenate([self.surface(frame)[0], [[0, 90.0, 0]]]),
    )
    start = _start(capture, 1)
    assert start.source == "the capture's surface points" and len(start.points) == 3000
    assert np.abs(_outside(start.points, capture.center(1))).max() < 1e-9


def test_else_the_hull_of_the_masks_of_training_cameras(moving_ball):
    capture = moving_ball([0.0, 0.3])
    start = _start(capture, 1)
    assert start.source == "the visual hull of 6 masks" and start.points.shape == (3000, 3)
    away = _outside(start.points, capture.center(1))
    # six cameras at one height leave corners; a pixel is 1 cm wide
    assert away.min() > -0.02 and np.median(away) < 0.02 and away.max() < 0.15
    # the hull begins at the very frame
    assert np.abs(_start(capture, 0).points - capture.center(0)).min() < 0.2
    np.testing.assert_array_equal(_start(capture, 1).points, start.points)


def test_a_bad_mask_is_named(moving_ball, monkeypatch):
    capture = moving_ball([0.0], 12)
    masks = type(capture).mask
    monkeypatch.setattr(type(capture), "mask", lambda s, c, f: masks(s, c, f) * (c != 3))
    start = _start(capture)
    assert start.source == (
        "the visual hull of 9 masks (ignored, as it contradicts the others: camera c3)"
    )
    assert _outside(start.points, capture.center(0)).min() > -0.04


def test_else_random_places_that_the_cameras_look_at(moving_ball, monkeypatch):
    capture = moving_ball([0.0])
    monkeypatch.setattr(type(capture), "mask", lambda *_: None)
    start = _start(capture)
    assert start.source == "random places before the cameras" and len(start.points) == 3000
    assert 0.7 < np.linalg.norm(start.points, axis=1).max() < 0.9
    capture.cameras = capture.cameras[:1] * 2
    with pytest.raises(CaptureError, match="cannot be placed in depth"):
        _start(capture)


def test_colours_come_from_the_pictures_that_see_a_point(moving_ball):
    capture = moving_ball([0.1])
    points, truth = capture.surface(0)
    colors = point_colors(points, capture, 0)
    assert colors.dtype == np.float32 and colors.shape == points.shape
    error = np.abs(colors - truth).mean(1)
    # seen between the pixels of a pattern that is a few pixels wide
    assert np.median(error) < 0.05 and np.quantile(error, 0.9) < 0.15
    # the ball hides part of the trunk and must not colour it, nor the other way round
    assert ((colors[:, 0] > 0.5) == (truth[:, 0] > 0.5)).mean() > 0.98
    assert {camera for camera, _ in capture.asked}.isdisjoint(capture.split.test_cameras)


def test_points_that_nothing_sees_are_grey(moving_ball):
    points = np.random.default_rng(0).random((9, 3)) + np.array([0, 50, 0])
    np.testing.assert_array_equal(point_colors(points, moving_ball([0.0]), 0), np.full((9, 3), 0.5))


def test_the_back_is_hidden_by_the_front(moving_ball):
    capture = moving_ball([0.1])
    points = capture.surface(0)[0][:2000]
    camera = capture.cameras[0]  # looks at it along z
    found = visible(points, camera, 0.08)
    normals = points / AXES**2
    facing = normals[:, 2] / np.linalg.norm(normals, axis=1)
    assert found[facing > 0.75].all() and not found[facing < -0.5].any()
