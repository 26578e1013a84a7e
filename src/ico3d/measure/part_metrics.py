"""Metrics of parts of a picture: motion, mouth, landmarks (docs/architecture.md, "Metrics")."""

from collections.abc import Sequence

import numpy as np

from ico3d.capture.face.region import MOUTH
from ico3d.common.psnr import psnr

MOTION = 25 / 255
"""Change of a colour channel between two frames above which a pixel counts as moving."""
SPREAD = 3
"""Distance in pixels from a moving pixel within which others count as moving, too."""
FEWEST_MOVING = 50
"""Least number of moving pixels of the person for which `psnr_moving` is defined.

A single moving pixel already makes 49 pixels count as moving.
"""

MOUTH_BOX = 1.5
"""Size of the box in which the mouth is judged, times that of the mouth's landmarks."""


def moving_pixels(picture: np.ndarray, neighbours: Sequence[np.ndarray]) -> np.ndarray:
    """Pixels that differ from the frame before or after, and those near them.

    Args:
        picture: (H, W, 3) recorded picture in [0, 1].
        neighbours: (H, W, 3) pictures of the same camera in the frames before and after, if
            recorded.

    Returns:
        (H, W) bool: within `SPREAD` pixels along rows and columns, some channel differs from some
        neighbour by more than `MOTION`.
    """
    from scipy.ndimage import maximum_filter

    moved = np.zeros(picture.shape[:2], bool)
    for other in neighbours:
        moved |= (np.abs(picture - other) > MOTION).any(-1)
    return maximum_filter(moved, size=2 * SPREAD + 1, mode="constant")


def psnr_moving(predicted: np.ndarray, truth: np.ndarray, weight: np.ndarray) -> float | None:
    """PSNR on moving pixels of the person.

    Args:
        predicted: (H, W, 3) in [0, 1].
        truth: (H, W, 3) in [0, 1].
        weight: (H, W) the mask of the person on pixels of `moving_pixels`, else 0.

    Returns:
        dB, or None if `weight` adds up to fewer than `FEWEST_MOVING` pixels.
    """
    return None if weight.sum() < FEWEST_MOVING else psnr(predicted, truth, weight)


def mouth_box(landmarks: np.ndarray, height: int, width: int) -> tuple[slice, slice] | None:
    """The box around the mouth's landmarks, enlarged by `MOUTH_BOX` about its centre.

    Args:
        landmarks: (68, 2) pixels.
        height: Image height in pixels.
        width: Image width in pixels.

    Returns:
        Slices of rows and columns within the image, or None if the box lies outside of it.
    """
    mouth = landmarks[MOUTH]
    low, high = mouth.min(0), mouth.max(0)
    middle, half = (low + high) / 2, (high - low) / 2 * MOUTH_BOX
    first = np.floor(np.maximum(middle - half, 0)).astype(int)
    last = np.ceil(np.minimum(middle + half, (width, height))).astype(int)
    if (last <= first).any():
        return None
    return slice(first[1], last[1]), slice(first[0], last[0])


def psnr_mouth(predicted: np.ndarray, truth: np.ndarray, landmarks: np.ndarray) -> float | None:
    """PSNR in dB within `mouth_box`, or None if that box lies outside of the picture."""
    box = mouth_box(landmarks, *truth.shape[:2])
    return None if box is None else psnr(predicted[box], truth[box])


def lmd(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Mean distance in pixels of the mouth's landmarks in two sets (68, 2), each centred first."""
    a, b = predicted[MOUTH], truth[MOUTH]
    return float(np.linalg.norm((a - a.mean(0)) - (b - b.mean(0)), axis=1).mean())
