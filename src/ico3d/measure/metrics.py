"""Picture metrics, each with one meaning everywhere (docs/architecture.md, "Metrics")."""

from collections.abc import Sequence

import numpy as np

from ico3d.common.psnr import psnr

MOUTH = slice(48, 68)
"""The mouth among the 68 landmarks."""

MOTION = 25 / 255
"""Change of a colour channel from frame to frame above which a pixel moves."""
SPREAD = 3
"""Pixels around a moving one that count as moving too."""
FEWEST_MOVING = 50
"""Moving pixels of the person below which a picture tells nothing about motion: a lone pixel
spreads over 49."""


def moving_pixels(picture: np.ndarray, neighbours: Sequence[np.ndarray]) -> np.ndarray:
    """Where something moves: what differs from the frame before or after, and what is near it.

    Args:
        picture: (H, W, 3) in [0, 1], as recorded.
        neighbours: The frames before and after by the same camera, as far as there are any.

    Returns:
        (H, W) bool: some channel differs from some neighbour by more than `MOTION` within `SPREAD`
        pixels along rows and columns.
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
        weight: (H, W) the mask where pixels move (`moving_pixels`), else 0.

    Returns:
        dB, or None where `weight` adds up to fewer than `FEWEST_MOVING` pixels.
    """
    return None if weight.sum() < FEWEST_MOVING else psnr(predicted, truth, weight)


def mouth_box(landmarks: np.ndarray, height: int, width: int) -> tuple[slice, slice] | None:
    """Rows and columns of the box of landmarks 48–67, grown by half about its middle.

    Args:
        landmarks: (68, 2) pixels.
        height: Image height.
        width: Image width.

    Returns:
        Row and column slices within the image, or None where the box lies outside of it.
    """
    mouth = landmarks[MOUTH]
    low, high = mouth.min(0), mouth.max(0)
    middle, half = (low + high) / 2, (high - low) / 2 * 1.5
    first = np.floor(np.maximum(middle - half, 0)).astype(int)
    last = np.ceil(np.minimum(middle + half, (width, height))).astype(int)
    if (last <= first).any():
        return None
    return slice(first[1], last[1]), slice(first[0], last[0])


def psnr_mouth(predicted: np.ndarray, truth: np.ndarray, landmarks: np.ndarray) -> float | None:
    """PSNR within `mouth_box`, or None where that lies outside of the picture."""
    box = mouth_box(landmarks, *truth.shape[:2])
    return None if box is None else psnr(predicted[box], truth[box])


def lmd(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Landmark distance of two sets (68, 2): mouth only, each less its own mean, in pixels."""
    a, b = predicted[MOUTH], truth[MOUTH]
    return float(np.linalg.norm((a - a.mean(0)) - (b - b.mean(0)), axis=1).mean())
