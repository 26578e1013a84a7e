"""Reads points of a body and of a hand in pictures with MediaPipe."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.capture.face.mediapipe_face import packed
from ico3d.common.native.hidden import hidden
from ico3d.common.native.messages import held_back
from ico3d.errors import CaptureError, MissingExtraError

PURPOSE = "fitting a skeleton"
"""What the models are needed for, in error messages."""
LEAST_CONFIDENCE = 0.3
"""Least confidence of detections. It is low, as comparing cameras sorts out wrong detections."""


@dataclass(frozen=True)
class Body:
    """The 33 points of a person in a picture.

    Attributes:
        pixels: (33, 2) pixels; centres are at +0.5.
        visibility: (33,) visibility of the points in [0, 1].
        relative: (33, 3) positions relative to the middle of the hips, in axes of the camera
            (OpenCV), metres.
    """

    pixels: np.ndarray
    visibility: np.ndarray
    relative: np.ndarray


@dataclass(frozen=True)
class Hand:
    """The 21 points of a hand in a picture.

    Attributes:
        pixels: (21, 2) pixels; centres are at +0.5.
        left: Whether it looks like a left hand.
        score: Certainty of the side, in [0.5, 1].
    """

    pixels: np.ndarray
    left: bool
    score: float


class BodyReader:
    """Finds one person or one hand in a picture, independently of other pictures."""

    def __init__(self, body_model: Path, hand_model: Path):
        """Loads the models.

        Args:
            body_model: `pose_landmarker.task`.
            hand_model: `hand_landmarker.task`.

        Raises:
            MissingExtraError: If MediaPipe is not installed.
            CaptureError: If a model file cannot be used.
        """
        self._mediapipe, vision, base = _imported(body_model)
        self._bodies = _opened(
            body_model,
            lambda: vision.PoseLandmarker.create_from_options(
                vision.PoseLandmarkerOptions(
                    base_options=base,
                    running_mode=vision.RunningMode.IMAGE,
                    min_pose_detection_confidence=LEAST_CONFIDENCE,
                    min_pose_presence_confidence=LEAST_CONFIDENCE,
                )
            ),
        )
        self._hands = HandReader(hand_model)

    def close(self) -> None:
        """Closes the models."""
        self._bodies.close()
        self._hands.close()

    def body(self, picture: np.ndarray) -> Body | None:
        """The person in a picture, uint8 RGB (H, W, 3); None where there is none."""
        found = self._bodies.detect(packed(self._mediapipe, picture))
        if not found.pose_landmarks:
            return None
        seen, space = found.pose_landmarks[0], found.pose_world_landmarks[0]
        return Body(
            _pixels(seen, picture),
            np.array([point.visibility for point in seen]),
            np.array([(point.x, point.y, point.z) for point in space]),
        )

    def hand(self, picture: np.ndarray) -> Hand | None:
        """The hand in a picture, uint8 RGB (H, W, 3); None where there is none."""
        return next(iter(self._hands.hands(picture)), None)


class HandReader:
    """Finds hands in a picture, independently of other pictures."""

    def __init__(self, model: Path, most: int = 1, confidence: float = LEAST_CONFIDENCE):
        """Loads the model.

        Args:
            model: `hand_landmarker.task`.
            most: Number of hands that are looked for in a picture.
            confidence: Least confidence of a detection, 0 to 1.

        Raises:
            MissingExtraError: If MediaPipe is not installed.
            CaptureError: If the model file cannot be used.
        """
        self._used = False
        self._mediapipe, vision, base = _imported(model)
        self._hands = _opened(
            model,
            lambda: vision.HandLandmarker.create_from_options(
                vision.HandLandmarkerOptions(
                    base_options=base,
                    running_mode=vision.RunningMode.IMAGE,
                    num_hands=most,
                    min_hand_detection_confidence=confidence,
                    min_hand_presence_confidence=confidence,
                )
            ),
        )

    def close(self) -> None:
        """Closes the model."""
        self._hands.close()

    def hands(self, picture: np.ndarray) -> list[Hand]:
        """As many hands of a picture, uint8 RGB (H, W, 3), as are looked for."""
        with nullcontext() if self._used else held_back():  # what the first one says of pictures
            found = self._hands.detect(packed(self._mediapipe, picture))
        self._used = True
        return [
            Hand(_pixels(points, picture), sides[0].category_name == "Left", float(sides[0].score))
            for points, sides in zip(found.hand_landmarks, found.handedness, strict=True)
        ]


def _imported(model: Path) -> tuple[Any, Any, Any]:
    """MediaPipe, its tasks for pictures, and the options that name a model."""
    try:
        with hidden("sounddevice"):  # which looks for a library in the current folder
            import mediapipe
            from mediapipe.tasks.python import BaseOptions, vision
    except ImportError as error:
        raise MissingExtraError("mediapipe", "face", PURPOSE) from error
    return mediapipe, vision, BaseOptions(model_asset_path=str(model))


def _opened(model: Path, load: Callable[[], Any]) -> Any:
    try:
        with held_back():
            return load()
    except (RuntimeError, ValueError, OSError) as error:
        raise CaptureError(f"{model} is no usable model of MediaPipe's: {error}.") from error


def _pixels(points: Any, picture: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of points that are given relative to the picture's width and height."""
    height, width = picture.shape[:2]
    return np.array([(point.x * width, point.y * height) for point in points])
