"""How pictures are divided into those to learn from and those to measure with."""

import numpy as np

from ico3d.capture.capture import all_frames, last_eleventh
from ico3d.common.camera import Camera, look_at


def ring(count: int, order: np.ndarray) -> list[Camera]:
    """Cameras on a circle, numbered in a given order."""
    angles = 2 * np.pi * order / count + 0.1
    eye = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    return [
        Camera(8, 8, eye, look_at((3 * np.sin(a), 1, 3 * np.cos(a)), (0, 1, 0)), str(i))
        for i, a in enumerate(angles)
    ]


def test_bodies_test_with_every_fifth_camera_by_azimuth():
    """However the cameras are numbered."""
    order = np.random.default_rng(1).permutation(20)
    split = all_frames(7, ring(20, order))
    assert split.train == tuple(range(7)) and split.test == ()
    steps = np.diff(sorted(order[list(split.test_cameras)]))
    assert len(split.test_cameras) == 4 and (steps == 5).all()


def test_two_cameras_both_train():
    """Nothing is held out where nothing can be spared."""
    assert all_frames(3, ring(2, np.arange(2))).test_cameras == ()


def test_heads_test_with_the_last_eleventh_of_the_frames():
    """110 frames: the last ten."""
    assert last_eleventh(110).test == tuple(range(100, 110))


def test_validation_cameras_are_training_cameras_away_from_tests():
    """Every tenth of the ring; a ring of fewer than five has none to spare."""
    order = np.random.default_rng(2).permutation(20)
    split = all_frames(7, ring(20, order))
    validation = order[list(split.validation_cameras)]
    assert len(validation) == 2 and abs(validation[0] - validation[1]) == 10
    steps = np.abs(np.subtract.outer(validation, order[list(split.test_cameras)]))
    assert np.minimum(steps, 20 - steps).min() == 2
    assert all_frames(7, ring(5, np.arange(5))).validation_cameras != ()
    assert all_frames(7, ring(4, np.arange(4))).validation_cameras == ()
