"""The numbers of the rendering convention that `render` describes; both backends read them."""

from math import exp

GSPLAT = (1, 5, 3), (1, 6)
"""The first version of gsplat that follows these numbers, and the first one that no longer does.

gsplat 1.6 limits alpha to 0.99 and bounds the low-pass's factor on opacity from below.
"""

BLUR = 0.3
"""Low-pass added to both diagonal entries of the 2D covariance, pixels squared."""

NEAR = 0.01
"""Gaussians closer than this to the camera plane are not drawn, metres."""

FRUSTUM_MARGIN = 0.3
"""The Jacobian is taken at most this many half image sizes outside of the image."""

MIN_ALPHA = 1 / 255
"""A splat ends where its alpha falls below this."""

MAX_ALPHA = 0.999
"""No splat hides more than this share of what lies behind it."""

MIN_TRANSMITTANCE = 1e-4
"""A pixel is finished before its transmittance would fall to this."""

SSIM_RADIUS = 5
"""The window of SSIM is 11 pixels wide."""

SSIM_SIGMA = 1.5
"""Standard deviation of SSIM's window, pixels."""

SSIM_C1, SSIM_C2 = 0.01**2, 0.03**2
"""SSIM's two small constants for images in [0, 1]."""


def ssim_window() -> list[float]:
    """The 11 weights of SSIM's Gaussian window; their sum is 1."""
    offsets = range(-SSIM_RADIUS, SSIM_RADIUS + 1)
    weights = [exp(-(i**2) / (2 * SSIM_SIGMA**2)) for i in offsets]
    return [weight / sum(weights) for weight in weights]
