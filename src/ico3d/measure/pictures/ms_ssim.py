"""MS-SSIM: structural similarity over five scales."""

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d, conv2d

from ico3d.splat.device import CPU

EXPONENTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Weight of each scale, the finest first (Wang, Simoncelli and Bovik 2003, section 3.2)."""
WINDOW, SIGMA = 11, 1.5
"""Side in pixels and standard deviation of the Gaussian window."""
LUMINANCE, CONTRAST = 0.01**2, 0.03**2
"""Constants of Wang et al. 2004 for colours in [0, 1]."""
LEAST_SIDE = WINDOW * 2 ** (len(EXPONENTS) - 1)
"""Shortest side in pixels of a picture that holds one window at the coarsest scale."""


def ms_ssim(predicted: np.ndarray, truth: np.ndarray, device: torch.device = CPU) -> float | None:
    """Multi-scale structural similarity (Wang, Simoncelli and Bovik 2003, eq. 7).

    Contrast and structure at five scales and luminance at the coarsest, raised to `EXPONENTS`. At
    each scale the index is the mean over the windows that lie in the picture entirely, as in the
    authors' own program; between scales, means of 2 × 2 pixels are taken. Of the three colours, for
    which the authors give no rule, the mean is taken. Negative means count as 0.

    Args:
        predicted: (H, W, 3) in [0, 1].
        truth: (H, W, 3) in [0, 1].
        device: Device to compute on.

    Returns:
        1 for equal pictures; None if a side has fewer than `LEAST_SIDE` (176) pixels.
    """
    if min(truth.shape[:2]) < LEAST_SIDE:
        return None
    pair = torch.stack([torch.from_numpy(picture).float() for picture in (predicted, truth)])
    pair = pair.to(device).permute(3, 0, 1, 2)  # (3, 2, H, W)
    total = torch.ones(3, device=device)
    for scale, exponent in enumerate(EXPONENTS):
        if scale:
            pair = avg_pool2d(pair, 2)  # (3, 2, H / 2, W / 2)
        luminance, contrast = _indices(pair)
        last = scale == len(EXPONENTS) - 1
        index = (luminance * contrast if last else contrast).mean((1, 2))  # (3,)
        total = total * index.clamp_min(0) ** exponent
    return float(total.mean())


def _indices(pair: Tensor) -> tuple[Tensor, Tensor]:
    """Luminance, and contrast with structure, of the windows of two pictures.

    Args:
        pair: (C, 2, H, W).

    Returns:
        Two tensors (C, H − 10, W − 10).
    """
    a, b = pair[:, 0], pair[:, 1]  # (C, H, W)
    mean_a, mean_b, aa, bb, ab = _window_means(torch.stack([a, b, a * a, b * b, a * b]))
    squares = mean_a**2 + mean_b**2
    luminance = (2 * mean_a * mean_b + LUMINANCE) / (squares + LUMINANCE)
    covariance = ab - mean_a * mean_b
    return luminance, (2 * covariance + CONTRAST) / (aa + bb - squares + CONTRAST)


def _window_means(maps: Tensor) -> Tensor:
    """Gaussian means (K, C, H − 10, W − 10) of maps (K, C, H, W): along columns, then rows."""
    steps = torch.arange(WINDOW, device=maps.device) - WINDOW // 2
    window = torch.exp(-(steps**2) / (2 * SIGMA**2))  # (11,)
    window = window / window.sum()
    flat = maps.flatten(0, 1)[:, None]  # (K·C, 1, H, W)
    flat = conv2d(conv2d(flat, window.view(1, 1, -1, 1)), window.view(1, 1, 1, -1))
    return flat.view(*maps.shape[:2], *flat.shape[2:])
