"""3D Gaussians to 2D ones, for several cameras at once (EWA splatting with a low-pass filter)."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

from math import log, sqrt

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.convention import BLUR, MIN_ALPHA, NEAR
from ico3d.splat.cpu.compile import kernel, subroutine
from ico3d.splat.cpu.geometry import (
    camera_space,
    determinant,
    dot,
    jacobian,
    pixel_from_world,
    rotation,
    row_times_scaled,
)

FARTHEST = 1e6
"""Largest extent of a splat in pixels; tile counts must fit into integers."""


@subroutine()
def _project(camera, mean, quat, scale, opacity, width, height, antialiased, mean2d, conic, extent):
    """Projects one Gaussian; returns its depth and the opacity left after the low-pass.

    A Gaussian that nobody sees has opacity and extent 0.
    """
    x, y, z = camera_space(camera, mean)
    mean2d[:], conic[:], extent[:] = 0, 0, 0
    if not z >= NEAR:
        return z, 0.0
    j00, j02, j11, j12 = jacobian(camera, x, y, z, width, height)
    row_x, row_y = pixel_from_world(camera, j00, j02, j11, j12)
    turn = rotation(quat[0], quat[1], quat[2], quat[3])
    p, q = row_times_scaled(row_x, turn, scale), row_times_scaled(row_y, turn, scale)
    xx, xy, yy, sharp = dot(p, p), dot(p, q), dot(q, q), determinant(p, q)
    blurred = sharp + BLUR * (xx + yy) + BLUR * BLUR
    left = opacity * sqrt(sharp / blurred) if antialiased else opacity
    if not left >= MIN_ALPHA:
        return z, 0.0
    reach = sqrt(2 * log(left / MIN_ALPHA))
    reach_x, reach_y = reach * sqrt(xx + BLUR), reach * sqrt(yy + BLUR)
    reach_x, reach_y = min(reach_x, FARTHEST), min(reach_y, FARTHEST)
    u, v = camera[0] * x / z + camera[2], camera[1] * y / z + camera[3]
    if u + reach_x <= 0 or u - reach_x >= width or v + reach_y <= 0 or v - reach_y >= height:
        return z, 0.0
    mean2d[0], mean2d[1] = u, v
    conic[0], conic[1], conic[2] = (yy + BLUR) / blurred, -xy / blurred, (xx + BLUR) / blurred
    extent[0], extent[1] = reach_x, reach_y
    return z, left


@kernel(parallel=True)
def _project_all(
    cameras,
    means,
    quats,
    scales,
    opacities,
    width,
    height,
    antialiased,
    means2d,
    conics,
    alphas,
    depths,
    reach,
):
    for i in numba.prange(means.shape[0]):
        for c in range(cameras.shape[0]):
            depths[c, i], alphas[c, i] = _project(
                cameras[c],
                means[i],
                quats[i],
                scales[i],
                opacities[i],
                width,
                height,
                antialiased,
                means2d[c, i],
                conics[c, i],
                reach[c, i],
            )


def project(
    cameras: np.ndarray,
    means: np.ndarray,
    quats: np.ndarray,
    scales: np.ndarray,
    opacities: np.ndarray,
    width: int,
    height: int,
    antialiased: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Projects N Gaussians into C cameras.

    Args:
        cameras: (C, 16) float64, laid out as described at `geometry.CAMERA_SIZE`.
        means: (N, 3) float32 centres in the world, metres.
        quats: (N, 4) float32 rotations wxyz.
        scales: (N, 3) float32 standard deviations, metres.
        opacities: (N,) float32.
        width: Image width in pixels, the same for all cameras.
        height: Image height in pixels.
        antialiased: Whether a splat's opacity is reduced where the low-pass filter enlarges it.

    Returns:
        means2d (C, N, 2) in pixels; conics (C, N, 3), the entries xx, xy, yy of the inverse of the
        blurred 2D covariance; opacities (C, N) after the low-pass filter; depths (C, N) along z in
        metres; extents (C, N, 2), half sizes in pixels of the box outside of which a splat ends.
        Extent and opacity are 0 for Gaussians that a camera does not see.
    """
    shape = (len(cameras), len(means))
    means2d = np.empty((*shape, 2), np.float32)
    conics = np.empty((*shape, 3), np.float32)
    alphas = np.empty(shape, np.float32)
    depths = np.empty(shape, np.float32)
    extents = np.empty((*shape, 2), np.float32)
    _project_all(
        cameras,
        means,
        quats,
        scales,
        opacities,
        width,
        height,
        antialiased,
        means2d,
        conics,
        alphas,
        depths,
        extents,
    )
    return means2d, conics, alphas, depths, extents
