"""SSIM, L1 and squares of two pictures with their gradient: blurs over rows of interleaved RGB.

SSIM asks for the sum of both variances alone, so x² + y² is blurred as one map.
"""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.convention import SSIM_C1, SSIM_C2, SSIM_RADIUS, ssim_window
from ico3d.splat.cpu.compile import kernel, subroutine

CHANNELS = 3
PAD = SSIM_RADIUS * CHANNELS
MOMENTS = 4
"""Blurred maps: x, y, x² + y², xy."""
W0, W1, W2, W3, W4, W5 = map(np.float32, ssim_window()[SSIM_RADIUS:])
C1, C2 = np.float32(SSIM_C1), np.float32(SSIM_C2)
ONE, TWO = np.float32(1), np.float32(2)


@subroutine()
def _blur_row(padded, out):
    """Blurs a row along x; `padded` has `PAD` zeros at both ends."""
    for i in range(out.size):
        out[i] = (
            W0 * padded[i + 15]
            + W1 * (padded[i + 12] + padded[i + 18])
            + W2 * (padded[i + 9] + padded[i + 21])
            + W3 * (padded[i + 6] + padded[i + 24])
            + W4 * (padded[i + 3] + padded[i + 27])
            + W5 * (padded[i] + padded[i + 30])
        )


@subroutine()
def _near_rows(a, b, c, d, e, out):
    for i in range(out.size):
        out[i] = W0 * c[i] + W1 * (b[i] + d[i]) + W2 * (a[i] + e[i])


@subroutine()
def _far_rows(a, b, c, d, e, f, out):
    for i in range(out.size):
        out[i] += W3 * (c[i] + d[i]) + W4 * (b[i] + e[i]) + W5 * (a[i] + f[i])


@subroutine()
def _blur_column(rows, out):
    """Blurs along y: the weighted sum of 11 rows.

    Half of them at a time: LLVM gives up where it must check many arrays for overlap.
    """
    _near_rows(rows[3], rows[4], rows[5], rows[6], rows[7], out)
    _far_rows(rows[0], rows[1], rows[2], rows[8], rows[9], rows[10], out)


@subroutine()
def _copy(a, out):
    """`out[:] = a`, which takes seconds to compile for what it would say if sizes differed."""
    for i in range(a.size):
        out[i] = a[i]


@subroutine()
def _product(a, b, out):
    for i in range(a.size):
        out[i] = a[i] * b[i]


@subroutine()
def _squares(a, b, out):
    for i in range(a.size):
        out[i] = a[i] * a[i] + b[i] * b[i]


@subroutine()
def _moments(x, y, padded, maps):
    """Rows of x, y, x² + y², xy, blurred along x."""
    inner = padded[PAD : PAD + x.size]
    _copy(x, inner)
    _blur_row(padded, maps[0])
    _copy(y, inner)
    _blur_row(padded, maps[1])
    _squares(x, y, inner)
    _blur_row(padded, maps[2])
    _product(x, y, inner)
    _blur_row(padded, maps[3])


@subroutine()
def _similarity(stats, by_mean):
    """Sum of SSIM over a row; overwrites the blurred x² + y², xy with the derivatives by them.

    `by_mean` gets the derivative by blurred x.
    """
    mean_x, mean_y, both, xy = stats[0], stats[1], stats[2], stats[3]
    total = np.float32(0)
    for i in range(by_mean.size):
        mx, my = mean_x[i], mean_y[i]
        a1, b1 = TWO * mx * my + C1, mx * mx + my * my + C1
        a2 = TWO * (xy[i] - mx * my) + C2
        b2 = both[i] - mx * mx - my * my + C2
        scale = ONE / (b1 * b2)
        value = a1 * a2 * scale
        total += value
        by_mean[i] = TWO * scale * (my * (a2 - a1) + mx * value * (b1 - b2))
        both[i] = -value * b1 * scale
        xy[i] = TWO * a1 * scale
    return total


@subroutine()
def _combine(x, y, by_mean, by_xx, by_xy, scale, out):
    for i in range(out.size):
        out[i] = scale * (by_mean[i] + TWO * x[i] * by_xx[i] + y[i] * by_xy[i])


@subroutine()
def _add_differences(x, y, by_absolute, by_square, out):
    """Sums of |x − y| and (x − y)² over a row; adds their weighted derivatives to `out`."""
    absolute, square = np.float32(0), np.float32(0)
    for i in range(out.size):
        away = x[i] - y[i]
        sign = np.float32(away > 0) - np.float32(away < 0)
        absolute += abs(away)
        square += away * away
        out[i] += by_absolute * sign + by_square * away
    return absolute, square


@kernel(parallel=True)
def _blur_moments(x, y, maps):
    for row in numba.prange(x.shape[0]):
        padded = np.zeros(x.shape[1] + 2 * PAD, np.float32)
        _moments(x[row], y[row], padded, maps[SSIM_RADIUS + row])


@kernel(parallel=True)
def _compare(maps, sums, derivatives):
    for row in numba.prange(sums.shape[0]):
        width = maps.shape[2]
        stats = np.empty((MOMENTS, width), np.float32)
        by_mean = np.empty(width, np.float32)
        for k in range(MOMENTS):
            _blur_column(maps[row : row + 11, k], stats[k])
        sums[row, 0] = _similarity(stats, by_mean)
        padded = np.zeros(width + 2 * PAD, np.float32)
        inner = padded[PAD : PAD + width]
        _copy(by_mean, inner)
        _blur_row(padded, derivatives[SSIM_RADIUS + row, 0])
        _copy(stats[2], inner)
        _blur_row(padded, derivatives[SSIM_RADIUS + row, 1])
        _copy(stats[3], inner)
        _blur_row(padded, derivatives[SSIM_RADIUS + row, 2])


@kernel(parallel=True)
def _pull_back(x, y, derivatives, scales, sums, gradient):
    for row in numba.prange(x.shape[0]):
        blurred = np.empty((3, x.shape[1]), np.float32)
        for k in range(3):
            _blur_column(derivatives[row : row + 11, k], blurred[k])
        out = gradient[row]
        _combine(x[row], y[row], blurred[0], blurred[1], blurred[2], scales[0], out)
        sums[row, 1], sums[row, 2] = _add_differences(x[row], y[row], scales[1], scales[2], out)


def _padded_rows(height: int, maps: int, width: int) -> np.ndarray:
    """Room for rows of maps, with rows of zeros above and below."""
    rows = np.empty((height + 2 * SSIM_RADIUS, maps, width), np.float32)
    rows[:SSIM_RADIUS] = 0
    rows[-SSIM_RADIUS:] = 0
    return rows


def photometric_with_gradient(
    x: np.ndarray, y: np.ndarray, similarity: float, l1: float, squares: float
) -> tuple[float, np.ndarray]:
    """The weighted sum of 1 − SSIM, mean |x − y| and mean (x − y)², and its gradient.

    Args:
        x: (H, W, 3) float32 in [0, 1].
        y: (H, W, 3) float32 in [0, 1].
        similarity: Weight of 1 − SSIM.
        l1: Weight of the mean absolute difference.
        squares: Weight of the mean squared difference.

    Returns:
        The sum, and its gradient (H, W, 3) with respect to x.
    """
    height, width = x.shape[0], x.shape[1] * CHANNELS
    x, y = x.reshape(height, width), y.reshape(height, width)
    maps, derivatives = _padded_rows(height, MOMENTS, width), _padded_rows(height, 3, width)
    sums, gradient = np.empty((height, 3), np.float32), np.empty_like(x)
    scales = np.array([-similarity, l1, 2 * squares]).astype(np.float32) / np.float32(x.size)
    _blur_moments(x, y, maps)
    _compare(maps, sums, derivatives)
    _pull_back(x, y, derivatives, scales, sums, gradient)
    alike, absolute, square = sums.sum(0, dtype=np.float64) / x.size
    value = similarity * (1 - alike) + l1 * absolute + squares * square
    return float(value), gradient.reshape(height, -1, CHANNELS)
