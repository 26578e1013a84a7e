"""Gradients of the projection, including the effect of the low-pass filter on opacity."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

from math import sqrt

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.convention import BLUR
from ico3d.splat.cpu.compile import PARTS, kernel, subroutine
from ico3d.splat.cpu.geometry import (
    camera_space,
    clamped_slope,
    determinant,
    dot,
    jacobian,
    pixel_from_world,
    rotation,
    row_times_scaled,
)

GRADIENTS = 11
"""Gradients per Gaussian: mean (3), quaternion (4), scale (3), opacity."""
POSE = 12
"""Gradients per camera: rotation (9, row by row), translation (3)."""


@subroutine()
def _covariance_gradient(xx, xy, yy, sharp, opacity, antialiased, g_conic, g_alpha):
    """Gradient of the sharp covariance's entries xx, xy, yy, and of the opacity.

    The conic K = Σ⁻¹ gives −K·G·K; the opacity left is opacity·√(det Σ / det(Σ + blur)), or
    without anti-aliasing all of it.
    """
    a, d = xx + BLUR, yy + BLUR
    blurred = sharp + BLUR * (xx + yy) + BLUR * BLUR
    k0, k1, k2 = d / blurred, -xy / blurred, a / blurred
    g0, g1, g2 = g_conic[0], 0.5 * g_conic[1], g_conic[2]
    m00, m01 = g0 * k0 + g1 * k1, g0 * k1 + g1 * k2
    m10, m11 = g1 * k0 + g2 * k1, g1 * k1 + g2 * k2
    g_xx = -(k0 * m00 + k1 * m10)
    g_xy = -2 * (k0 * m01 + k1 * m11)
    g_yy = -(k1 * m01 + k2 * m11)
    if not antialiased:
        return g_xx, g_xy, g_yy, g_alpha
    factor = sqrt(sharp / blurred)
    g_ratio = 0.5 * g_alpha * opacity / (factor * blurred)
    ratio = sharp / blurred
    g_xx += g_ratio * (yy - ratio * d)
    g_xy -= g_ratio * 2 * xy * (1 - ratio)
    g_yy += g_ratio * (xx - ratio * a)
    return g_xx, g_xy, g_yy, g_alpha * factor


@subroutine()
def _local_gradient(camera, x, y, z, width, height, g_mean2d, g_depth, g_j):
    """Gradient of the mean in camera axes: by its pixel, its depth and the Jacobian taken at it."""
    fx, fy = camera[0], camera[1]
    slope_x = clamped_slope(x / z, fx, camera[2], width)
    slope_y = clamped_slope(y / z, fy, camera[3], height)
    zz = z * z
    g_x, g_y = g_mean2d[0] * fx / z, g_mean2d[1] * fy / z
    g_z = g_depth - (g_x * x + g_y * y) / z
    g_z += (g_j[1] * fx * slope_x + g_j[3] * fy * slope_y - g_j[0] * fx - g_j[2] * fy) / zz
    if slope_x == x / z:
        g_x -= g_j[1] * fx / zz
        g_z += g_j[1] * fx * slope_x / zz
    if slope_y == y / z:
        g_y -= g_j[3] * fy / zz
        g_z += g_j[3] * fy * slope_y / zz
    return g_x, g_y, g_z


@subroutine()
def _pose_gradient(local, mean, j, g_x, g_y, g_camera):
    """Adds the gradient of the camera's rotation (9, by rows) and translation (3).

    Args:
        local: Gradient of the mean in camera axes.
        mean: (3,) in the world.
        j: The Jacobian's entries 00, 02, 11, 12.
        g_x: Gradient of the first row of Jacobian times rotation.
        g_y: Gradient of the second row of Jacobian times rotation.
        g_camera: (12,) to add to.
    """
    for k in range(3):
        g_camera[k] += local[0] * mean[k] + j[0] * g_x[k]
        g_camera[3 + k] += local[1] * mean[k] + j[2] * g_y[k]
        g_camera[6 + k] += local[2] * mean[k] + j[1] * g_x[k] + j[3] * g_y[k]
        g_camera[9 + k] += local[k]


@subroutine()
def _quat_gradient(quat, g_turn, g_quat):
    """Adds the gradient of an unnormalised quaternion from that of its rotation matrix."""
    norm = 1.0 / sqrt(quat[0] ** 2 + quat[1] ** 2 + quat[2] ** 2 + quat[3] ** 2)
    w, x, y, z = quat[0] * norm, quat[1] * norm, quat[2] * norm, quat[3] * norm
    a, b, c = g_turn
    g_w = 2 * (x * (c[1] - b[2]) + y * (a[2] - c[0]) + z * (b[0] - a[1]))
    g_x = 2 * (w * (c[1] - b[2]) - 2 * x * (b[1] + c[2]) + y * (a[1] + b[0]) + z * (a[2] + c[0]))
    g_y = 2 * (w * (a[2] - c[0]) + x * (a[1] + b[0]) - 2 * y * (a[0] + c[2]) + z * (b[2] + c[1]))
    g_z = 2 * (w * (b[0] - a[1]) + x * (a[2] + c[0]) + y * (b[2] + c[1]) - 2 * z * (a[0] + b[1]))
    along = g_w * w + g_x * x + g_y * y + g_z * z
    g_quat[0] += (g_w - along * w) * norm
    g_quat[1] += (g_x - along * x) * norm
    g_quat[2] += (g_y - along * y) * norm
    g_quat[3] += (g_z - along * z) * norm


@subroutine()
def _unscale(row, a, g_a, b, g_b, scale):
    """Row of the gradient of R·S that pixel rows a and b give at world axis `row`."""
    return (
        (a[row] * g_a[0] + b[row] * g_b[0]) * scale[0],
        (a[row] * g_a[1] + b[row] * g_b[1]) * scale[1],
        (a[row] * g_a[2] + b[row] * g_b[2]) * scale[2],
    )


@subroutine()
def _back(row, turn, scale):
    """A gradient row times (R·S)ᵀ."""
    scaled = (row[0] * scale[0], row[1] * scale[1], row[2] * scale[2])
    return dot(turn[0], scaled), dot(turn[1], scaled), dot(turn[2], scaled)


@subroutine()
def _project_backward(
    camera, mean, quat, scale, opacity, width, height, antialiased, gradient, out, g_camera
):
    """Adds one Gaussian's gradients by one camera, and those of the camera's pose.

    `gradient` holds those of mean2d (2), conic (3), opacity left and depth; `out` takes those of
    mean (3), quaternion (4), scale (3) and opacity.
    """
    x, y, z = camera_space(camera, mean)
    j = jacobian(camera, x, y, z, width, height)
    row_x, row_y = pixel_from_world(camera, j[0], j[1], j[2], j[3])
    turn = rotation(quat[0], quat[1], quat[2], quat[3])
    p, q = row_times_scaled(row_x, turn, scale), row_times_scaled(row_y, turn, scale)
    xx, xy, yy, sharp = dot(p, p), dot(p, q), dot(q, q), determinant(p, q)
    g_xx, g_xy, g_yy, g_opacity = _covariance_gradient(
        xx, xy, yy, sharp, opacity, antialiased, gradient[2:5], gradient[5]
    )
    g_p = (
        2 * g_xx * p[0] + g_xy * q[0],
        2 * g_xx * p[1] + g_xy * q[1],
        2 * g_xx * p[2] + g_xy * q[2],
    )
    g_q = (
        2 * g_yy * q[0] + g_xy * p[0],
        2 * g_yy * q[1] + g_xy * p[1],
        2 * g_yy * q[2] + g_xy * p[2],
    )
    g_turn = (
        _unscale(0, row_x, g_p, row_y, g_q, scale),
        _unscale(1, row_x, g_p, row_y, g_q, scale),
        _unscale(2, row_x, g_p, row_y, g_q, scale),
    )
    g_x, g_y = _back(g_p, turn, scale), _back(g_q, turn, scale)
    right = (camera[4], camera[5], camera[6])
    down = (camera[7], camera[8], camera[9])
    forward = (camera[10], camera[11], camera[12])
    g_j = (dot(g_x, right), dot(g_x, forward), dot(g_y, down), dot(g_y, forward))
    local = _local_gradient(camera, x, y, z, width, height, gradient[0:2], gradient[6], g_j)
    _pose_gradient(local, mean, j, g_x, g_y, g_camera)
    _quat_gradient(quat, g_turn, out[3:7])
    for k in range(3):
        out[k] += right[k] * local[0] + down[k] * local[1] + forward[k] * local[2]
        along = turn[0][k] * g_turn[0][k] + turn[1][k] * g_turn[1][k] + turn[2][k] * g_turn[2][k]
        out[7 + k] += along / scale[k]
    out[10] += g_opacity


@kernel(parallel=True)
def _project_backward_all(
    cameras,
    means,
    quats,
    scales,
    opacities,
    width,
    height,
    antialiased,
    alphas,
    gradients,
    outs,
    g_cameras,
):
    parts, count = g_cameras.shape[0], means.shape[0]
    for part in numba.prange(parts):
        total = np.zeros(GRADIENTS)
        for i in range(part * count // parts, (part + 1) * count // parts):
            total[:] = 0
            for c in range(cameras.shape[0]):
                if alphas[c, i] > 0:
                    _project_backward(
                        cameras[c],
                        means[i],
                        quats[i],
                        scales[i],
                        opacities[i],
                        width,
                        height,
                        antialiased,
                        gradients[c, i],
                        total,
                        g_cameras[part, c],
                    )
            for k in range(GRADIENTS):  # a row as a whole takes seconds to compile
                outs[i, k] = total[k]


def project_backward(
    cameras: np.ndarray,
    means: np.ndarray,
    quats: np.ndarray,
    scales: np.ndarray,
    opacities: np.ndarray,
    width: int,
    height: int,
    antialiased: bool,
    alphas: np.ndarray,
    gradients: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients of `project`, summed over the cameras.

    Args:
        cameras: (C, 16) float64, as given to `project`.
        means: (N, 3) as given to `project`.
        quats: (N, 4) as given to `project`.
        scales: (N, 3) as given to `project`.
        opacities: (N,) as given to `project`.
        width: Image width in pixels.
        height: Image height in pixels.
        antialiased: As given to `project`.
        alphas: (C, N) opacities that `project` returned; Gaussians with 0 are skipped.
        gradients: (C, N, 7) gradients of the loss by means2d (2), conics (3), opacity, depth.

    Returns:
        (N, 11) float32 gradients of mean (3), quaternion (4), scale (3), opacity; and (C, 12)
        float64 gradients of each camera's rotation (9, row by row) and translation (3).
    """
    outs = np.empty((len(means), GRADIENTS), np.float32)
    # sums of fixed parts, so that they do not depend on the number of threads
    g_cameras = np.zeros((PARTS, len(cameras), POSE))
    _project_backward_all(
        cameras,
        means,
        quats,
        scales,
        opacities,
        width,
        height,
        antialiased,
        alphas,
        gradients,
        outs,
        g_cameras,
    )
    return outs, g_cameras.sum(0)
