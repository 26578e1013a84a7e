"""Cameras whose pictures cut a person off tell what they show, and guess nothing for others."""

import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from ico3d.capture.posing.seeing.agreement import CORE, LEAST_WEIGHT, NAMES, agreed_body
from ico3d.capture.posing.seeing.mediapipe_body import Body, BodyReader
from ico3d.capture.posing.seeing.sightings import GUESSED, POSE, Seen, Watcher
from ico3d.common.camera import Camera, look_at
from support.recordings import multiview_folders

LEGS = 25
"""MediaPipe's points from here on are those of knees and feet."""


class _Guessing(BodyReader):
    """Finds a whole person in every picture, the legs below the picture's lower border."""

    def __init__(self):
        pass  # needs no models

    def body(self, picture):
        pixels = np.full((33, 2), 0.5 * len(picture))
        pixels[LEGS:, 1] = 1.5 * len(picture)
        return Body(pixels, np.full(33, 0.8), np.zeros((33, 3)))


def _looked(path, cameras) -> Watcher:
    capture = open_capture(multiview_folders.write_folder(path))
    watcher = Watcher(capture, [_Guessing()], workers=1)
    watcher.seen = Seen(capture, watcher.seen.chosen[:cameras])
    watcher.look(bodies=True)
    return watcher


def test_of_several_cameras_one_takes_part_with_what_it_shows(tmp_path):
    weights = _looked(tmp_path / "clip", 2).seen.weights[0, :, POSE]  # (33, C)
    assert (weights[:LEGS] > 0.1).all()
    assert (weights[LEGS:] > 0).all() and (weights[LEGS:] <= LEAST_WEIGHT).all()


def test_the_guesses_of_a_single_camera_are_all_that_is_known(tmp_path):
    weights = _looked(tmp_path / "clip", 1).seen.weights[0, 0, POSE]
    np.testing.assert_allclose(weights[LEGS:], 0.8, rtol=1e-6)


@pytest.fixture(scope="module")
def ring():
    """Two cameras that show a whole person, and two that show them from the hips up."""
    cameras = []
    for number, (angle, focal) in enumerate([(0, 300), (90, 300), (45, 700), (-45, 700)]):
        side = np.radians(angle)
        eye = np.array([2.8 * np.sin(side), 1.1, 2.8 * np.cos(side)])
        aim = np.array([0.0, 1.0 if focal == 300 else 1.3, 0.0])
        lens = np.array([[focal, 0, 100.0], [0, focal, 150.0], [0, 0, 1]])
        cameras.append(Camera(200, 300, lens, look_at(eye, aim), str(number)))
    return cameras


def test_wrong_guesses_of_near_cameras_move_no_leg_and_their_arms_count(ring):
    random = np.random.default_rng(0)
    points = random.uniform((-0.25, 1.1, -0.1), (0.25, 1.6, 0.1), (len(NAMES), 3))
    arms, legs = CORE[:8], CORE[8:]
    points[legs, 1] = (0.5, 0.5, 0.1, 0.1)
    pixels = np.stack([camera.project(points)[0] for camera in ring])  # (C, P, 2)
    weights = np.full(pixels.shape[:2], 0.8)
    pixels[2:, legs] += random.uniform(-60, 60, (2, 4, 2))
    weights[2:, legs] *= GUESSED
    found = agreed_body(ring, pixels, weights)
    assert found is not None
    np.testing.assert_allclose(found.points[CORE], points[CORE], atol=1e-3)
    assert (found.weights[2:, arms] > 0.5).all()
