"""Peak signal-to-noise ratio, defined once for the whole project."""

import math

import numpy as np

LEAST_ERROR = 1e-12
"""Mean squared errors are taken to be at least this, which limits the PSNR to 120 dB."""


def decibels(error: float) -> float:
    """PSNR in dB, at most 120, of a mean squared error between colours in [0, 1]."""
    return -10 * math.log10(max(error, LEAST_ERROR))


def psnr(predicted: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> float | None:
    """PSNR of a picture in dB, over a mask where one is given.

    Args:
        predicted: (H, W, 3) in [0, 1].
        truth: (H, W, 3) in [0, 1].
        mask: (H, W) weights in [0, 1]; None for the whole picture.

    Returns:
        −10·log₁₀(Σ mask · err² / (3·Σ mask)), at most 120, or None where the mask is empty.
    """
    squares = (predicted.astype(np.float64) - truth) ** 2  # (H, W, 3)
    if mask is None:
        return decibels(float(squares.mean()))
    weight = float(mask.sum(dtype=np.float64))
    if weight == 0:
        return None
    return decibels(float((squares * mask[..., None]).sum()) / (3 * weight))
