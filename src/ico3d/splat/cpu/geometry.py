"""Kernels that project one Gaussian into one camera: the 2D covariance and its factors."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

from math import sqrt

from ico3d.splat.convention import FRUSTUM_MARGIN
from ico3d.splat.cpu.compile import subroutine

CAMERA_SIZE = 16
"""Numbers that describe a camera: fx, fy, cx, cy, rotation (9, row by row), translation (3)."""


@subroutine()
def rotation(w, x, y, z):
    """Rotation matrix of a quaternion as three rows; the quaternion need not be normalised."""
    norm = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w * norm, x * norm, y * norm, z * norm
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


@subroutine()
def camera_space(camera, mean):
    """A world point in the camera's axes."""
    x = camera[4] * mean[0] + camera[5] * mean[1] + camera[6] * mean[2] + camera[13]
    y = camera[7] * mean[0] + camera[8] * mean[1] + camera[9] * mean[2] + camera[14]
    z = camera[10] * mean[0] + camera[11] * mean[1] + camera[12] * mean[2] + camera[15]
    return x, y, z


@subroutine()
def clamped_slope(slope, focal, center, size):
    """The slope x/z, limited to a margin around the image, beyond which the linearisation fails."""
    margin = FRUSTUM_MARGIN * 0.5 * size / focal
    return min(max(slope, -center / focal - margin), (size - center) / focal + margin)


@subroutine()
def jacobian(camera, x, y, z, width, height):
    """The four non-zero entries of the projection's Jacobian: 00, 02, 11, 12."""
    slope_x = clamped_slope(x / z, camera[0], camera[2], width)
    slope_y = clamped_slope(y / z, camera[1], camera[3], height)
    return camera[0] / z, -camera[0] * slope_x / z, camera[1] / z, -camera[1] * slope_y / z


@subroutine()
def pixel_from_world(camera, j00, j02, j11, j12):
    """The projection's Jacobian times the camera's rotation: two rows of three numbers."""
    return (
        (
            j00 * camera[4] + j02 * camera[10],
            j00 * camera[5] + j02 * camera[11],
            j00 * camera[6] + j02 * camera[12],
        ),
        (
            j11 * camera[7] + j12 * camera[10],
            j11 * camera[8] + j12 * camera[11],
            j11 * camera[9] + j12 * camera[12],
        ),
    )


@subroutine()
def dot(a, b):
    """Dot product of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@subroutine()
def row_times_scaled(row, turn, scale):
    """A row times R·S: one row of the square root of the 2D covariance."""
    return (
        (row[0] * turn[0][0] + row[1] * turn[1][0] + row[2] * turn[2][0]) * scale[0],
        (row[0] * turn[0][1] + row[1] * turn[1][1] + row[2] * turn[2][1]) * scale[1],
        (row[0] * turn[0][2] + row[1] * turn[1][2] + row[2] * turn[2][2]) * scale[2],
    )


@subroutine()
def determinant(p, q):
    """Determinant of [p; q]·[p; q]ᵀ, computed as |p × q|² to avoid cancellation."""
    x = p[1] * q[2] - p[2] * q[1]
    y = p[2] * q[0] - p[0] * q[2]
    z = p[0] * q[1] - p[1] * q[0]
    return x * x + y * y + z * z
