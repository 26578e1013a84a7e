"""Picture metrics, with the one meaning they have everywhere (design, section 2)."""

import numpy as np

MOUTH = slice(48, 68)
"""The mouth among the 68 landmarks."""


def psnr(predicted: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> float | None:
    """Peak signal-to-noise ratio in dB, on the mask where one is given.

    Args:
        predicted: (H, W, 3) in [0, 1].
        truth: (H, W, 3) in [0, 1].
        mask: (H, W) weights in [0, 1].

    Returns:
        −10·log₁₀(Σ_mask err² / (3·Σ mask)), or None where the mask is empty.
    """
    squares = (predicted.astype(np.float64) - truth) ** 2  # (H, W, 3)
    if mask is None:
        error = squares.mean()
    else:
        weight = float(mask.sum(dtype=np.float64))
        if weight == 0:
            return None
        error = (squares * mask[..., None]).sum() / (3 * weight)
    return float(-10 * np.log10(max(error, 1e-12)))


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
