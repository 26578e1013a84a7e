"""Smooths poses as far as their measurement noise requires (Whittaker smoother)."""

from itertools import pairwise

import numpy as np
from scipy.linalg import solveh_banded
from scipy.spatial.transform import Rotation

from ico3d.capture.headpose.procrustes import RigidMotion

LONGEST_GAP = 5
"""Longest gap in frames that is bridged between two poses."""
CALMEST = 1e-3
"""Least variance of accelerations, as a share of that of noise alone."""


def smoothed_poses(motion: RigidMotion) -> np.ndarray:
    """The poses of a motion, smoothed as far as their noise requires; short gaps are bridged.

    A Whittaker smoother over quaternions and the position of the body's centre. Deviations are
    weighted by the variance of each pose, which follows from the points' spread, and second
    differences by the variance that they have beyond noise. Poses without noise stay as they are.

    Args:
        motion: Shape, poses and weights.

    Returns:
        (F, 4, 4) poses; NaN before the first and after the last pose, and in longer gaps.
    """
    poses = motion.poses
    known = np.isfinite(poses[:, 0, 0])
    kept = _bridged(known)
    if known.sum() < 3:
        return poses
    middle, places, turns = _precision(motion, known)
    centers = np.where(known[:, None], poses[:, :3, :3] @ middle + poses[:, :3, 3], 0.0)
    quaternions = _quaternions(poses, known)  # (F, 4)
    # Half the angle is what a quaternion changes by: four times the precision.
    quaternions = _whittaker(quaternions, 4.0 * turns, known)
    centers = _whittaker(centers, places, known)
    smooth = np.full(poses.shape, np.nan)
    smooth[kept] = np.eye(4)
    smooth[kept, :3, :3] = Rotation.from_quat(quaternions[kept]).as_matrix()
    smooth[kept, :3, 3] = centers[kept] - smooth[kept, :3, :3] @ middle
    return smooth


def _bridged(known: np.ndarray) -> np.ndarray:
    """(F,) bool: frames with a pose, and those in short gaps between."""
    kept = known.copy()
    frames = np.flatnonzero(known)
    for before, after in pairwise(frames):
        if after - before <= LONGEST_GAP + 1:
            kept[before:after] = True
    return kept


def _precision(motion: RigidMotion, known: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The middle of the body (3,), and inverse variances (F,) of its place and of its turn."""
    shape = np.nan_to_num(motion.shape)
    total = motion.weights.sum(1)  # (F,)
    middle = motion.weights.sum(0) @ shape / total.sum()
    arms = ((shape - middle) ** 2).sum(-1)  # (K,)
    # Points on a ball resist a turn about each axis by two thirds of their squared distance.
    turns = motion.weights @ arms * (2 / 3)
    return middle, np.where(known, total, 0.0), np.where(known, turns, 0.0)


def _quaternions(poses: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(F, 4) of known frames, their signs so that neighbours are near; 0 for the others."""
    found = Rotation.from_matrix(poses[known, :3, :3]).as_quat()
    flips = np.where((found[1:] * found[:-1]).sum(1) < 0, -1.0, 1.0)
    found[1:] *= np.cumprod(flips)[:, None]
    quaternions = np.zeros((len(poses), 4))
    quaternions[known] = found
    return quaternions


def _whittaker(values: np.ndarray, precision: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(F, C) smooth values from (F, C), of which those that are not known are found, too."""
    stated = float(np.median(1.0 / precision[known]))
    # Errors that last, such as those of an expression, do not jitter: fourth differences do.
    noise = min(stated, _mean_square(values, known, 4) / 70)
    motion = max(_mean_square(values, known, 2) - 6 * noise, CALMEST * 6 * noise)
    if noise == 0 or not np.isfinite(motion):
        return values
    # Everything in units of the noise, or numbers of 1e18 meet such of 1.
    relative = precision * stated
    smooth = solveh_banded(_bands(relative, noise / motion), relative[:, None] * values)
    return np.asarray(smooth)


def _mean_square(values: np.ndarray, known: np.ndarray, order: int) -> float:
    """Mean square of differences along each of three axes; infinite where there are none."""
    whole = ~np.convolve(~known, np.ones(order + 1), "valid").astype(bool)  # (F − order,)
    differences = np.diff(values, order, axis=0)[whole] if len(values) > order else values[:0]
    return float((differences**2).sum(1).mean() / 3) if len(differences) else float("inf")


def _bands(precision: np.ndarray, stiffness: float) -> np.ndarray:
    """(3, F) upper bands of diag(precision) + stiffness · DᵀD, D the second differences."""
    bands = np.zeros((3, len(precision)))
    bands[2] = precision
    for row, factor in ((slice(0, -2), 1.0), (slice(1, -1), 4.0), (slice(2, None), 1.0)):
        bands[2, row] += stiffness * factor
    bands[1, 1:-1] -= 2 * stiffness
    bands[1, 2:] -= 2 * stiffness
    bands[0, 2:] += stiffness
    return bands
