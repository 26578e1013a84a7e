"""Poses and weights in few bits, as a bundle keeps them."""

import numpy as np

from ico3d.bundle.skinned.baked import QUAT_UNIT, WEIGHT_UNIT
from ico3d.rig.quaternions import Array, continuous, normalized


def packed_quats(quats: Array) -> np.ndarray:
    """(..., 4) int16 of quaternions, which need not be normalised."""
    return np.rint(normalized(quats) * QUAT_UNIT).astype(np.int16)


def packed_weights(weights: Array) -> np.ndarray:
    """(N, 4) uint8 with sums of 255 of weights (N, 4) with sums of 1, each off by less than 1."""
    exact = weights.astype(np.float64) * WEIGHT_UNIT  # (N, 4)
    whole = np.floor(exact).astype(np.int64)
    missing = WEIGHT_UNIT - whole.sum(1, keepdims=True)  # (N, 1)
    rank = np.argsort(np.argsort(whole - exact, axis=1, kind="stable"), axis=1)  # (N, 4)
    return (whole + (rank < missing)).astype(np.uint8)


def packed_rotations(
    rotations: Array, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Recorded rotations without those of joints that stand still.

    Args:
        rotations: (F, J, 4) wxyz.
        tolerance: Degrees that a joint may turn and yet be held.

    Returns:
        `held` (J, 4) int16, `moving` (M,) uint8, `rotations` (F, M, 4) int16.
    """
    quats = continuous(normalized(rotations))  # (F, J, 4)
    middle = normalized(quats.mean(axis=0))  # (J, 4)
    cosines = np.abs((quats * middle).sum(-1)).clip(0, 1)  # (F, J)
    turned = np.degrees(2 * np.arccos(cosines)).max(axis=0)  # (J,)
    turned[0] = 180  # the root's, so that one turns at least
    moving = np.flatnonzero(turned > tolerance)
    return packed_quats(middle), moving.astype(np.uint8), packed_quats(quats[:, moving])
