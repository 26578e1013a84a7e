"""Pictures that would end the process never reach MediaPipe; a double stands for it."""

from types import SimpleNamespace

import numpy as np
import pytest

from ico3d.capture.decoding import MOST_SIDE
from ico3d.capture.face.mediapipe_face import FaceReader
from ico3d.capture.posing.seeing.mediapipe_body import BodyReader, HandReader
from ico3d.errors import CaptureError

NOTHING = SimpleNamespace(
    face_blendshapes=[],
    face_landmarks=[],
    facial_transformation_matrixes=[],
    pose_landmarks=[],
    hand_landmarks=[],
    handedness=[],
)


class MediaPipe:
    """Counts the pictures that it is given, and finds nothing in them."""

    ImageFormat = SimpleNamespace(SRGB=1)

    def __init__(self):
        self.given = []

    def Image(self, image_format, data):
        self.given.append(data.shape)

    def detect(self, picture):
        return NOTHING


def reader(kind, double):
    """A reader without its model."""
    made = kind.__new__(kind)
    made._mediapipe = made._landmarker = made._bodies = made._hands = double
    made._used = True
    return made


@pytest.mark.parametrize(
    ("kind", "look"), [(FaceReader, "faces"), (HandReader, "hands"), (BodyReader, "body")]
)
def test_long_pictures_are_refused_and_others_are_looked_at(kind, look):
    double = MediaPipe()
    seen = getattr(reader(kind, double), look)
    assert not seen(np.zeros((1, MOST_SIDE, 3), np.uint8))
    for shape in ((1, MOST_SIDE + 1, 3), (MOST_SIDE + 1, 1, 3)):
        with pytest.raises(CaptureError, match="larger than is taken"):
            seen(np.zeros(shape, np.uint8))
    assert double.given == [(1, MOST_SIDE, 3)]
