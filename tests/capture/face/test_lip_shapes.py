import numpy as np
import pytest

from ico3d.capture.capture import Capture
from ico3d.capture.face.lip_shapes import lip_shapes


class Told(Capture):
    """A capture of ten frames that tells what a test gives it."""

    blendshape_names = ("browInnerUp", "jawOpen", "mouthFunnel", "eyeBlinkLeft", "tongueOut")

    def image(self, camera, frame):
        return None

    def __init__(self, landmarks=None, weights=None):
        self._landmarks, self._weights = landmarks, weights

    def landmarks_3d(self, frame):
        return None if self._landmarks is None else self._landmarks[frame]

    def blendshapes(self, frame):
        return None if self._weights is None else self._weights[frame]


@pytest.fixture
def landmarks():
    return np.random.default_rng(0).normal(size=(10, 68, 3))


@pytest.fixture
def weights():
    return np.random.default_rng(1).random((10, 5))


def test_landmarks_of_the_mouth_come_first(landmarks, weights):
    found = lip_shapes(Told(landmarks, weights), [7, 2])
    np.testing.assert_array_equal(found, landmarks[[7, 2], 48:].reshape(2, 60))


def test_else_blendshapes_that_move_the_mouth(landmarks, weights):
    landmarks[3] = np.nan
    found = lip_shapes(Told(landmarks, weights), range(10))
    np.testing.assert_array_equal(found, weights[:, [1, 2, 4]])
    assert lip_shapes(Told(landmarks, weights), [4]).shape == (1, 60)


def test_nothing_where_nothing_is_told(weights):
    assert lip_shapes(Told(), range(10)) is None
    assert lip_shapes(Told(weights=weights), []) is None
    weights[5, 1] = np.nan
    assert lip_shapes(Told(weights=weights), range(10)) is None
    other = Told(weights=weights[:5])
    other.blendshape_names = ("redden", "pale", "unused", "a", "b")
    assert lip_shapes(other, range(5)) is None
