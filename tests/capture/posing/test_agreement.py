"""Cameras that take left for right, or see somebody else, are found out."""

import numpy as np
import pytest

from ico3d.capture.posing.model.naming import opposite
from ico3d.capture.posing.model.template import load_template
from ico3d.capture.posing.seeing.agreement import HANDS, NAMES, Placed, agreed_body, agreed_hands
from support.needs import needs
from support.recordings.multiview_folders import ring

pytestmark = needs("anny")
OTHER = np.array([NAMES.index(opposite(name)) for name in NAMES])


@pytest.fixture
def seen():
    """Six cameras, the true points, and where they are seen to parts of a pixel."""
    cameras, points = ring(6, (480, 640)), load_template().places[0].copy()
    points -= points.mean(0)
    random = np.random.default_rng(1)
    pixels = np.stack([camera.project(points)[0] for camera in cameras])
    return cameras, points, pixels + random.normal(0, 0.02, pixels.shape)


def test_exchanged_sides_are_put_right_and_strangers_are_left_out(seen):
    cameras, points, pixels = seen
    pixels[2] = pixels[2][OTHER]
    pixels[4] += np.random.default_rng(2).normal(0, 9, pixels[4].shape)
    found = agreed_body(cameras, pixels, np.ones(pixels.shape[:2]))
    assert found is not None
    assert found.weights[4].max() == 0 and (found.weights[2] > 0).mean() > 0.9
    assert np.linalg.norm(found.points - points, axis=1).max() < 0.01


def test_the_majority_tells_left_from_right(seen):
    cameras, points, pixels = seen
    pixels[[0, 1]] = pixels[[0, 1]][:, OTHER]
    found = agreed_body(cameras, pixels, np.ones(pixels.shape[:2]))
    assert found is not None
    assert np.linalg.norm(found.points - points, axis=1).max() < 0.01


def test_cameras_that_contradict_each_other_give_nothing(seen):
    cameras, _, pixels = seen
    pixels += np.random.default_rng(3).normal(0, 9, pixels.shape)
    assert agreed_body(cameras, pixels, np.ones(pixels.shape[:2])) is None
    weights = np.zeros(pixels.shape[:2])
    weights[0] = 1
    assert agreed_body(cameras, pixels, weights) is None


def test_a_hand_that_one_camera_sees_elsewhere_loses_its_say(seen):
    cameras, points, pixels = seen
    pixels[3][HANDS[0]] += 5
    body = Placed(pixels, np.ones(pixels.shape[:2]), points)
    found = agreed_hands(cameras, body)
    assert found.weights[3][HANDS[0]].max() == 0 and found.weights[3][HANDS[1]].min() > 0
    assert np.linalg.norm(found.points - points, axis=1)[HANDS[0]].max() < 0.005
