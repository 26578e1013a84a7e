"""Numba kernels of the space-time encoder at one scale and one time, forward and backward.

At one time the three time planes are lines (see `encoder._line`), so samples of three planes and
three lines are multiplied. Channels are the innermost axis, in groups of `LANES`: loops over them
have a fixed length, which LLVM unrolls.
"""

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.cpu.compile import kernel, subroutine

LANES = 16
"""Channels in a group."""
ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)


@subroutine(inline=True)
def _place(position, places):
    """Where a position in −1 … 1 lies among nodes.

    Returns the node before the position, the share of the way to the next node, and the derivative
    of that share by the position, which is 0 on the border and outside (as in torch).
    """
    scale = HALF * np.float32(places - 1)
    place = (position + ONE) * scale
    slope = scale if ZERO < place < np.float32(places - 1) else ZERO
    place = min(max(place, ZERO), np.float32(places - 1))
    node = min(max(int(place), 0), places - 2)  # clamped as well, for a NaN position
    return node, place - np.float32(node), slope


@subroutine(inline=True)
def _corners(plane, row, column, group):
    """Views of a group of channels at the four nodes about a place.

    They are (row, column), (row, column + 1), (row + 1, column) and (row + 1, column + 1).
    """
    return (
        plane[row, column, group],
        plane[row, column + 1, group],
        plane[row + 1, column, group],
        plane[row + 1, column + 1, group],
    )


@subroutine(inline=True)
def _sample(corners, x, y, out):
    """Writes the bilinear sample of four nodes: `x` is the share of columns, `y` that of rows."""
    a, b, c, d = corners
    wa, wb, wc, wd = (ONE - y) * (ONE - x), (ONE - y) * x, y * (ONE - x), y * x
    for k in range(LANES):
        out[k] = wa * a[k] + wb * b[k] + wc * c[k] + wd * d[k]


@subroutine(inline=True)
def _sample_line(line, node, part, group, out):
    """Writes the linear sample between a node and the next."""
    a, b = line[node, group], line[node + 1, group]
    for k in range(LANES):
        out[k] = (ONE - part) * a[k] + part * b[k]


@subroutine(inline=True)
def _sample_all(planes, lines, x, y, z, group, samples):
    """Writes the samples of xy, xz, yz, xt, yt and zt, in this order, `LANES` numbers each."""
    _sample(_corners(planes[0], y[0], x[0], group), x[1], y[1], samples)
    _sample(_corners(planes[1], z[0], x[0], group), x[1], z[1], samples[LANES:])
    _sample(_corners(planes[2], z[0], y[0], group), y[1], z[1], samples[2 * LANES :])
    _sample_line(lines[0], x[0], x[1], group, samples[3 * LANES :])
    _sample_line(lines[1], y[0], y[1], group, samples[4 * LANES :])
    _sample_line(lines[2], z[0], z[1], group, samples[5 * LANES :])


@subroutine(inline=True)
def _product(s, out):
    for k in range(LANES):
        first = s[k] * s[LANES + k] * s[2 * LANES + k]
        out[k] = first * s[3 * LANES + k] * s[4 * LANES + k] * s[5 * LANES + k]


@subroutine(inline=True)
def _product_backward(s, gradient):
    """Writes the gradients of the six samples behind the six samples."""
    for k in range(LANES):
        a, b, c = s[k], s[LANES + k], s[2 * LANES + k]
        d, e, f = s[3 * LANES + k], s[4 * LANES + k], s[5 * LANES + k]
        g = gradient[k]
        cd, ef, ab = c * d, e * f, a * b
        first, second, third = g * cd * ef, g * ab * ef, g * ab * cd
        s[6 * LANES + k] = first * b
        s[7 * LANES + k] = first * a
        s[8 * LANES + k] = second * d
        s[9 * LANES + k] = second * c
        s[10 * LANES + k] = third * f
        s[11 * LANES + k] = third * e


@subroutine(inline=True)
def _add(out, weight, gradient):
    for k in range(LANES):
        out[k] += weight * gradient[k]


@subroutine(inline=True)
def _scatter(corners, sums, x, y, gradient):
    """Adds to the gradients of four nodes; returns the derivatives by the shares x and y."""
    a, b, c, d = corners
    ga, gb, gc, gd = ZERO, ZERO, ZERO, ZERO
    for k in range(LANES):
        g = gradient[k]
        ga += g * a[k]
        gb += g * b[k]
        gc += g * c[k]
        gd += g * d[k]
    _add(sums[0], (ONE - y) * (ONE - x), gradient)
    _add(sums[1], (ONE - y) * x, gradient)
    _add(sums[2], y * (ONE - x), gradient)
    _add(sums[3], y * x, gradient)
    return (ONE - y) * (gb - ga) + y * (gd - gc), (ONE - x) * (gc - ga) + x * (gd - gb)


@subroutine(inline=True)
def _scatter_line(line, sums, node, part, group, gradient):
    """Adds to the gradients of two nodes; returns the derivative by the share `part`."""
    a, b = line[node, group], line[node + 1, group]
    total = ZERO
    for k in range(LANES):
        total += gradient[k] * (b[k] - a[k])
    _add(sums[node, group], ONE - part, gradient)
    _add(sums[node + 1, group], part, gradient)
    return total


@kernel(parallel=True)
def forward(hands, xy, xz, yz, xt, yt, zt, positions, out):
    """Writes the features of all points.

    Args:
        hands: Number of threads that share the points.
        xy: (S, S, groups, LANES) plane; rows are y, columns x.
        xz: (S, S, groups, LANES) plane; rows are z, columns x.
        yz: (S, S, groups, LANES) plane; rows are z, columns y.
        xt: (S, groups, LANES) line along x at the time.
        yt: (S, groups, LANES) line along y.
        zt: (S, groups, LANES) line along z.
        positions: (N, 3), −1 … 1 inside the box.
        out: (N, groups, LANES) features, written.
    """
    places, count = xy.shape[0], len(positions)
    planes, lines = (xy, xz, yz), (xt, yt, zt)
    for hand in numba.prange(hands):
        samples = np.empty(6 * LANES, np.float32)
        for i in range(hand * count // hands, (hand + 1) * count // hands):
            x = _place(positions[i, 0], places)
            y = _place(positions[i, 1], places)
            z = _place(positions[i, 2], places)
            for group in range(xy.shape[2]):
                _sample_all(planes, lines, x, y, z, group, samples)
                _product(samples, out[i, group])


@kernel(parallel=True)
def backward(xy, xz, yz, xt, yt, zt, positions, gradient, g_planes, g_lines, g_positions):
    """Gradients of `forward`.

    Args:
        xy: (S, S, groups, LANES) plane, as given to `forward`.
        xz: (S, S, groups, LANES) plane.
        yz: (S, S, groups, LANES) plane.
        xt: (S, groups, LANES) line.
        yt: (S, groups, LANES) line.
        zt: (S, groups, LANES) line.
        positions: (N, 3), as given to `forward`.
        gradient: (N, groups, LANES) gradient of the features.
        g_planes: (hands, 3, S, S, groups, LANES), added to; its sum over the parts of the points
            (`hands`) is the gradient of the planes.
        g_lines: (hands, 3, S, groups, LANES), added to; likewise of the lines.
        g_positions: (N, 3), added to.
    """
    places, count, hands = xy.shape[0], len(positions), len(g_planes)
    planes, lines = (xy, xz, yz), (xt, yt, zt)
    for hand in numba.prange(hands):
        s = np.empty(12 * LANES, np.float32)
        sums, line_sums = g_planes[hand], g_lines[hand]
        for i in range(hand * count // hands, (hand + 1) * count // hands):
            x = _place(positions[i, 0], places)
            y = _place(positions[i, 1], places)
            z = _place(positions[i, 2], places)
            gx, gy, gz = ZERO, ZERO, ZERO
            for group in range(xy.shape[2]):
                _sample_all(planes, lines, x, y, z, group, s)
                _product_backward(s, gradient[i, group])
                own = _corners(xy, y[0], x[0], group)
                into = _corners(sums[0], y[0], x[0], group)
                by_x, by_y = _scatter(own, into, x[1], y[1], s[6 * LANES :])
                gx, gy = gx + by_x, gy + by_y
                own = _corners(xz, z[0], x[0], group)
                into = _corners(sums[1], z[0], x[0], group)
                by_x, by_z = _scatter(own, into, x[1], z[1], s[7 * LANES :])
                gx, gz = gx + by_x, gz + by_z
                own = _corners(yz, z[0], y[0], group)
                into = _corners(sums[2], z[0], y[0], group)
                by_y, by_z = _scatter(own, into, y[1], z[1], s[8 * LANES :])
                gy, gz = gy + by_y, gz + by_z
                gx += _scatter_line(xt, line_sums[0], x[0], x[1], group, s[9 * LANES :])
                gy += _scatter_line(yt, line_sums[1], y[0], y[1], group, s[10 * LANES :])
                gz += _scatter_line(zt, line_sums[2], z[0], z[1], group, s[11 * LANES :])
            g_positions[i, 0] += gx * x[2]
            g_positions[i, 1] += gy * y[2]
            g_positions[i, 2] += gz * z[2]
