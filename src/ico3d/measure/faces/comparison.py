"""Compares the faces of two videos of one person, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ico3d.capture.face.landmarks import MULTI_PIE
from ico3d.capture.face.mediapipe_face import MESH_LANDMARKS, Face
from ico3d.measure.faces.blendshapes import blendshape_error
from ico3d.measure.faces.identity import identity_distances, identity_of
from ico3d.measure.lips import lip_correlation, lip_gap, lip_lag_ms
from ico3d.measure.part_metrics import lmd

METRICS = (
    *("lmd", "lip_correlation", "lip_lag_ms", "blendshape_error_lower"),
    *("blendshape_error_upper", "identity_distance", "identity_drift"),
)
"""What `FaceComparison.figures` returns."""


@dataclass
class FaceComparison:
    """Takes faces frame by frame, and compares them once all are there.

    Attributes:
        rigidity: (468,) weights of the landmarks for the shape of the skull.
    """

    rigidity: np.ndarray
    _landmarks: list[tuple[np.ndarray | None, np.ndarray | None]] = field(default_factory=list)
    _faces: list[tuple[Face | None, Face | None]] = field(default_factory=list)

    def add(
        self, predicted: Face | None, truth: Face | None, landmarks: np.ndarray | None = None
    ) -> None:
        """Takes the next frame.

        Args:
            predicted: The face as it was rendered; None if none was seen.
            truth: The face as it was recorded; None if none was seen.
            landmarks: (68, 2) pixels of the recorded face, if they are known better.
        """
        self._faces.append((predicted, truth))
        seen, true = (
            None if face is None else face.landmarks[MULTI_PIE] for face in self._faces[-1]
        )
        self._landmarks.append((seen, true if landmarks is None else landmarks))

    def figures(self, fps: float, names: Sequence[str]) -> dict[str, float | None]:
        """The metrics `METRICS`; None where too few frames show a face.

        Args:
            fps: Frames per second.
            names: Names of the faces' blendshapes.
        """
        found: dict[str, float | None] = dict.fromkeys(METRICS)
        return found | self._lips(fps) | self._expression(names) | self._identity()

    def _lips(self, fps: float) -> dict[str, float | None]:
        """Distance of the mouth's landmarks, correlation and lag of its opening."""
        both = [(a, b) for a, b in self._landmarks if a is not None and b is not None]
        gaps = np.array([_gap_or_nan(seen) for seen, _ in self._landmarks])
        truth = np.array([_gap_or_nan(true) for _, true in self._landmarks])
        return {
            "lmd": float(np.mean([lmd(a, b) for a, b in both])) if both else None,
            "lip_correlation": lip_correlation(gaps, truth),
            "lip_lag_ms": lip_lag_ms(gaps, truth, fps),
        }

    def _expression(self, names: Sequence[str]) -> dict[str, float]:
        """Errors of blendshapes."""
        both = [(a, b) for a, b in self._faces if a is not None and b is not None]
        if not both:
            return {}
        predicted = np.stack([a.blendshapes for a, _ in both])  # (T, 52)
        error = blendshape_error(predicted, np.stack([b.blendshapes for _, b in both]), names)
        assert error is not None
        return {"blendshape_error_lower": error.lower, "blendshape_error_upper": error.upper}

    def _identity(self) -> dict[str, float | None]:
        """Distance of the shapes of the faces, and its drift."""
        points, truth = (_points([pair[side] for pair in self._faces]) for side in (0, 1))
        found = identity_of(identity_distances(points, truth, self.rigidity))
        if found is None:
            return {}
        return {"identity_distance": found.distance, "identity_drift": found.drift}


def _gap_or_nan(landmarks: np.ndarray | None) -> float:
    return float("nan") if landmarks is None else lip_gap(landmarks)


def _points(faces: list[Face | None]) -> np.ndarray:
    """(T, 468, 3) landmarks in three dimensions, NaN where there is no face or no depth."""
    found = np.full((len(faces), MESH_LANDMARKS, 3), np.nan)
    for row, face in zip(found, faces, strict=True):
        if face is not None and face.depths is not None:
            row[:, :2] = face.landmarks[:MESH_LANDMARKS]
            row[:, 2] = face.depths[:MESH_LANDMARKS]
    return found
