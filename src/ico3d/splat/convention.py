"""The numbers of the rendering convention that `render` describes; both backends read them."""

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
