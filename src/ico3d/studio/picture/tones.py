"""From linear light to display values: a filmic curve, then sRGB, once for each finished pixel."""

import numpy as np

from ico3d.splat.cpu.compile import kernel

EXPOSURE = 0.72
"""Factor of linear light before the curve: a white wall in full key light stays below white."""


@kernel(fast=False)
def display(value):
    """The display value in [0, 1] of linear light: a filmic curve, then the sRGB curve.

    The curve is Narkowicz's fit of the ACES film response: shadows gain contrast, lights roll off.
    """
    x = max(0.0, value) * EXPOSURE
    film = min(1.0, x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14))
    if film <= 0.0031308:
        return 12.92 * film
    return 1.055 * film ** (1.0 / 2.4) - 0.055


@kernel(fast=False)
def developed(linear):
    """Display values of a picture in linear light.

    Args:
        linear: (H, W, 4) float32 light of the person, premultiplied by alpha, and alpha.

    Returns:
        (H, W, 4) float32 display values, premultiplied by alpha, and alpha.
    """
    out = np.zeros_like(linear)
    for y in range(linear.shape[0]):
        for x in range(linear.shape[1]):
            alpha = linear[y, x, 3]
            if alpha > 0.0:
                for c in range(3):
                    out[y, x, c] = alpha * display(linear[y, x, c] / alpha)
                out[y, x, 3] = min(1.0, alpha)
    return out
