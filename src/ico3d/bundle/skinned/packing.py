"""Packs poses and weights into the few bits in which a bundle keeps them."""

import numpy as np

from ico3d.bundle.skinned.baked import WEIGHT_UNIT
from ico3d.bundle.tensors import QUAT_UNIT
from ico3d.rig.quaternions import Array, continuous, normalized


def packed_quats(quats: Array) -> np.ndarray:
    """(..., 4) int16 in units of 1/32767 of quaternions (..., 4) of any length."""
    return np.rint(normalized(quats) * QUAT_UNIT).astype(np.int16)


def packed_weights(weights: Array) -> np.ndarray:
    """(N, 4) uint8 with row sums of 255 from weights (N, 4) with row sums of 1.

    Each of them differs from 255 times the weight by less than 1.
    """
    exact = weights.astype(np.float64) * WEIGHT_UNIT  # (N, 4)
    whole = np.floor(exact).astype(np.int64)
    missing = WEIGHT_UNIT - whole.sum(1, keepdims=True)  # (N, 1)
    rank = np.argsort(np.argsort(whole - exact, axis=1, kind="stable"), axis=1)  # (N, 4)
    return (whole + (rank < missing)).astype(np.uint8)


def packed_rotations(
    rotations: Array, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Packs recorded rotations, with one rotation only for joints that hardly turn.

    Args:
        rotations: (F, J, 4) local rotations of the joints, wxyz.
        tolerance: Largest angle in degrees from a joint's mean rotation up to which it is held.

    Returns:
        `held` (J, 4) int16, `moving` (M,) uint8 and `rotations` (F, M, 4) int16 of `BakedSkinned`.
    """
    quats = continuous(normalized(rotations))  # (F, J, 4)
    middle = normalized(quats.mean(axis=0))  # (J, 4)
    cosines = np.abs((quats * middle).sum(-1)).clip(0, 1)  # (F, J)
    turned = np.degrees(2 * np.arccos(cosines)).max(axis=0)  # (J,)
    turned[0] = 180  # the root always counts as moving, so that at least one joint does
    moving = np.flatnonzero(turned > tolerance)
    return packed_quats(middle), moving.astype(np.uint8), packed_quats(quats[:, moving])
