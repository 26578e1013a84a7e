"""Metrics of lip movement: correlation and delay of the mouth's opening over time."""

import logging
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ico3d.errors import MissingExtraError, MissingModelError

if TYPE_CHECKING:
    from ico3d.capture.face.mediapipe_face import Face

UPPER_INNER_LIP = (61, 62, 63)
LOWER_INNER_LIP = (67, 66, 65)
LONGEST_LAG = 0.4
"""Largest delay in seconds at which the correlation's peak is searched."""

log = logging.getLogger(__name__)


def lip_gap(landmarks: np.ndarray) -> float:
    """Distance of the inner lips in pixels, from the 68 landmarks (68, 2)."""
    between = landmarks[list(UPPER_INNER_LIP)] - landmarks[list(LOWER_INNER_LIP)]  # (3, 2)
    return float(np.linalg.norm(between, axis=1).mean())


def lip_correlation(gaps: np.ndarray, truth: np.ndarray) -> float | None:
    """Pearson correlation of two series (T,) without a shift; frames with NaN are left out.

    Returns:
        The correlation; None if fewer than 8 frames are left or a series is constant.
    """
    both = np.isfinite(gaps) & np.isfinite(truth)
    a, b = gaps[both], truth[both]
    if both.sum() < 8 or a.std() < 1e-9 or b.std() < 1e-9:
        return None
    return float(np.corrcoef(a, b)[0, 1])


def lip_lag_ms(gaps: np.ndarray, truth: np.ndarray, fps: float) -> float | None:
    """Delay of the series `gaps` (T,) behind `truth` (T,), in milliseconds.

    Correlations are computed at shifts of whole frames; a parabola through the highest and its
    neighbours gives fractions of a frame.

    Returns:
        The delay, positive if `gaps` is late; None if there is no correlation, or if it still grows
        at the largest delay that is tried.
    """
    reach = min(round(LONGEST_LAG * fps), len(gaps) // 2)
    values = [_shifted_correlation(gaps, truth, shift) for shift in range(-reach, reach + 1)]
    if any(value is None for value in values):
        return None
    series = np.array(values, float)
    peak = int(series.argmax())
    if not 0 < peak < len(series) - 1:
        return None
    before, at, after = series[peak - 1 : peak + 2]
    offset = 0.5 * (before - after) / (before - 2 * at + after)
    return float((peak - reach + offset) / fps * 1000)


def _shifted_correlation(gaps: np.ndarray, truth: np.ndarray, shift: int) -> float | None:
    """Correlation of gaps[t + shift] with truth[t]."""
    if shift < 0:
        return lip_correlation(gaps[:shift], truth[-shift:])
    return lip_correlation(gaps[shift:], truth[: len(truth) - shift])


class LandmarkReader:
    """Finds the face in a picture with MediaPipe."""

    def __init__(self):
        """Loads MediaPipe and its model.

        Raises:
            MissingExtraError: If MediaPipe is not installed.
            MissingModelError: If the model file is not installed.
        """
        from ico3d.capture.face.mediapipe_face import FaceReader
        from ico3d.common.weights import model_file

        self._model = model_file("face_landmarker.task", "measuring lips")
        self._reader = FaceReader(self._model)

    def __enter__(self) -> "LandmarkReader":
        return self

    def __exit__(self, *details) -> None:
        self._reader.__exit__(*details)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the blendshapes of faces; empty until a face was found."""
        return self._reader.names

    @cached_property
    def rigidity(self) -> np.ndarray:
        """(468,) how rigidly each landmark of the face's surface sits on the skull, 0 to 1."""
        from ico3d.capture.face.mediapipe_face import canonical_face

        return canonical_face(self._model).rigidity

    def read(self, picture: np.ndarray, mask: np.ndarray | None = None) -> np.ndarray | None:
        """The landmarks of a face in a picture (see `face`): (68, 2) pixels, or None."""
        from ico3d.capture.face.landmarks import MULTI_PIE

        face = self.face(picture, mask)
        return None if face is None else face.landmarks[MULTI_PIE]

    def face(self, picture: np.ndarray, mask: np.ndarray | None = None) -> "Face | None":
        """The face in a picture.

        Args:
            picture: (H, W, 3) in [0, 1].
            mask: (H, W) the person; a face that is small in the picture is searched in parts of the
                person. None searches the whole picture only.

        Returns:
            The face, in pixels of the picture; None if none is found.
        """
        from ico3d.capture.headtrack.crops import search

        face = self._reader.read((np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8))
        if face is not None:
            return face
        height, width = picture.shape[:2]
        for part in [] if mask is None else search(height, width, mask):
            face = self._reader.read(part.cut(np.clip(picture, 0, 1)))
            if face is not None:
                return part.whole_face(face)
        return None


def landmark_reader() -> LandmarkReader | None:
    """A reader; None, with a warning, if MediaPipe or its model is missing."""
    try:
        return LandmarkReader()
    except (MissingExtraError, MissingModelError) as error:
        log.warning(
            "lips are not measured, nor expression and identity, nor mouths in pictures without "
            "landmarks of their own: %s",
            error,
        )
        return None
