"""How a face's landmarks move against the skull in the frames of a capture."""

from collections.abc import Sequence

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.face.canonical import rays_to_landmarks

HOLD = 1e-3
"""Weight, against that of one ray, by which a landmark stays where it is on average.

A single camera says nothing of the depth of a landmark, which then keeps its mean one.
"""
STEADY = (*range(27, 36), 36, 39, 42, 45)
"""Landmarks that stay on the skull whatever the face does: the nose and the corners of the eyes."""
NOISE, SHIFT, TURN = 0.001, 0.003, 0.05
"""Usual error of a landmark, and of a head's pose, metres and radians."""


def landmark_motion(capture: Capture, frames: Sequence[int], rest: np.ndarray) -> np.ndarray:
    """(F, 68, 3) how far landmarks are from where they rest, metres in canonical head space.

    These are 3D landmarks where the format has them. Otherwise each frame's are found from the 2D
    landmarks of all cameras. What nose and eyes do together is left out: it is an error of the
    head's pose, and no skin moves with it.

    Args:
        capture: The recording.
        frames: F frames.
        rest: (68, 3) mean landmarks, by `canonical_landmarks`.

    Returns:
        NaN in frames that tell no landmarks.
    """
    return np.stack([_moves(capture, frame, rest) for frame in frames])


def _moves(capture: Capture, frame: int, rest: np.ndarray) -> np.ndarray:
    """(68, 3) how far the landmarks of a frame are from rest, NaN if it tells none."""
    given = capture.landmarks_3d(frame)
    if given is not None and np.isfinite(given).all():
        normal, right = np.tile(np.eye(3), (len(rest), 1, 1)), np.asarray(given, np.float64)
    else:
        normal, right, rays = rays_to_landmarks(capture, frame)
        if not rays:
            return np.full_like(rest, np.nan, dtype=np.float64)
    missing = right - (normal @ rest[..., None])[..., 0]  # (68, 3)
    ways = _rigid_ways(rest)  # (68, 3, 6)
    missing -= (normal @ (ways @ _rigid(normal, missing, ways))[..., None])[..., 0]
    return np.linalg.solve(normal + HOLD * np.eye(3), missing[..., None])[..., 0]


def _rigid_ways(rest: np.ndarray) -> np.ndarray:
    """(P, 3, 6) how points (P, 3) go with small shifts along the axes and turns about them."""
    x, y, z = rest.T
    zero = np.zeros_like(x)
    turns = np.stack([[zero, z, -y], [-z, zero, x], [y, -x, zero]])  # (3, 3, P)
    shifts = np.tile(np.eye(3), (len(rest), 1, 1))
    return np.concatenate([shifts, turns.transpose(2, 0, 1)], 2)


def _rigid(normal: np.ndarray, missing: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """(6,) shift and turn of the steady landmarks, as `normal` and `missing` tell them."""
    some = list(STEADY)
    held = np.diag([(NOISE / SHIFT) ** 2] * 3 + [(NOISE / TURN) ** 2] * 3)
    left = np.einsum("pai,pab,pbj->ij", ways[some], normal[some], ways[some])
    return np.linalg.solve(left + held, np.einsum("pai,pa->i", ways[some], missing[some]))
