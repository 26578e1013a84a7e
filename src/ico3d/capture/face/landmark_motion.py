"""How a face's landmarks move against the skull in the frames of a capture."""

from collections.abc import Sequence

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.face.canonical import rays_to_landmarks

HOLD = 1e-3
"""Weight, against that of one ray, by which a landmark stays where it is on average.

A single camera says nothing of the depth of a landmark, which then keeps its mean one.
"""


def landmark_motion(capture: Capture, frames: Sequence[int], rest: np.ndarray) -> np.ndarray:
    """(F, 68, 3) how far landmarks are from where they rest, metres in canonical head space.

    These are 3D landmarks where the format has them. Otherwise each frame's are found from the 2D
    landmarks of all cameras.

    Args:
        capture: The recording.
        frames: F frames.
        rest: (68, 3) mean landmarks, by `canonical_landmarks`.

    Returns:
        NaN in frames that tell no landmarks.
    """
    return np.stack([_places(capture, frame, rest) - rest for frame in frames])


def _places(capture: Capture, frame: int, rest: np.ndarray) -> np.ndarray:
    """(68, 3) the landmarks of a frame, NaN if it tells none."""
    given = capture.landmarks_3d(frame)
    if given is not None and np.isfinite(given).all():
        return np.asarray(given, np.float64)
    normal, right, rays = rays_to_landmarks(capture, frame)
    if not rays:
        return np.full_like(rest, np.nan, dtype=np.float64)
    normal = normal + HOLD * np.eye(3)
    return np.linalg.solve(normal, (right + HOLD * rest)[..., None])[..., 0]
