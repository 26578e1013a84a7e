"""The shape of the lips in each frame of a capture, as far as the capture tells it."""

from collections.abc import Sequence

import numpy as np

from ico3d.capture.capture import Capture

MOUTH_BLENDSHAPES = ("jaw", "mouth", "tongue")
"""Beginnings of the names of blendshapes that move lips, jaw and tongue (ARKit)."""
MOUTH_LANDMARKS = slice(48, 68)


def lip_shapes(capture: Capture, frames: Sequence[int]) -> np.ndarray | None:
    """(F, K) lip values of frames: 3D landmarks in head space, or blendshapes of mouth and jaw.

    Returns:
        Finite values; None if the capture does not tell them in every frame.
    """
    for values in (_landmarks, _blendshapes):
        rows = [values(capture, frame) for frame in frames]
        if rows and all(row is not None and np.isfinite(row).all() for row in rows):
            return np.stack(rows).astype(np.float64)  # type: ignore[arg-type]
    return None


def _landmarks(capture: Capture, frame: int) -> np.ndarray | None:
    """(60,) places of the lips in canonical head space, metres."""
    points = capture.landmarks_3d(frame)
    return None if points is None else points[MOUTH_LANDMARKS].ravel()


def _blendshapes(capture: Capture, frame: int) -> np.ndarray | None:
    """(K,) weights of the blendshapes of mouth and jaw."""
    names, values = capture.blendshape_names, capture.blendshapes(frame)
    if names is None or values is None:
        return None
    chosen = [i for i, name in enumerate(names) if name.lower().startswith(MOUTH_BLENDSHAPES)]
    return np.asarray(values)[chosen] if chosen else None
