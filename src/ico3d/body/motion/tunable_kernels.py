"""Numba kernels of the tunable MLP: all layers over a block of points, forward and backward.

A block has one row of `BLOCK` numbers per feature, one number per point. Loops run over the points
of a row, with the weights as factors that stay in registers, and the rows of a block stay in the
cache from layer to layer. A layer of M sets is one matrix product of its "blended" rows: the
features times α_1, …, the features times α_M, and α_1 … α_M themselves (for the biases). Numbers of
rows are rounded up to multiples of four (`padded`), with rows of zeros.
"""

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.cpu.compile import PARTS, kernel, subroutine

BLOCK = 128
"""Points in a block."""
FOUR = 4
"""Rows that are multiplied at once."""
ZERO = np.float32(0)


def padded(rows: int) -> int:
    """A number of rows, rounded up to a multiple of four."""
    return -(-rows // FOUR) * FOUR


@subroutine()
def _read(values, first, rows):
    """Writes the rows of the block of points from `first` on; zeros past the last point."""
    count = min(BLOCK, values.shape[0] - first)
    for k in range(values.shape[1]):
        row = rows[k * BLOCK : (k + 1) * BLOCK]
        for p in range(count):
            row[p] = values[first + p, k]
        row[count:] = ZERO
    rows[values.shape[1] * BLOCK :] = ZERO


@subroutine()
def _write(rows, first, values):
    """Copies the rows of a block into the values of its points; inverse of `_read`."""
    for p in range(min(BLOCK, values.shape[0] - first)):
        for k in range(values.shape[1]):
            values[first + p, k] = rows[k * BLOCK + p]


@subroutine()
def _blend(x, inputs, alpha, sets, out):
    """Writes a layer's blended rows: features times each α, then α, then zeros."""
    for m in range(sets):
        factor = alpha[m * BLOCK : (m + 1) * BLOCK]
        for k in range(inputs):
            source = x[k * BLOCK : (k + 1) * BLOCK]
            target = out[(m * inputs + k) * BLOCK : (m * inputs + k + 1) * BLOCK]
            for p in range(BLOCK):
                target[p] = factor[p] * source[p]
    last = out[sets * inputs * BLOCK :]
    for p in range(sets * BLOCK):  # `last[:] = alpha[:]` takes seconds to compile
        last[p] = alpha[p]
    last[sets * BLOCK :] = ZERO


@subroutine()
def _unblend(x, inputs, alpha, sets, gradient, g_x, g_alpha):
    """From the gradient of blended rows: writes that of the features, adds to that of α."""
    g_x[:] = ZERO
    for m in range(sets):
        factor = alpha[m * BLOCK : (m + 1) * BLOCK]
        by_factor = g_alpha[m * BLOCK : (m + 1) * BLOCK]
        own = gradient[(sets * inputs + m) * BLOCK : (sets * inputs + m + 1) * BLOCK]
        for p in range(BLOCK):
            by_factor[p] += own[p]
        for k in range(inputs):
            source = x[k * BLOCK : (k + 1) * BLOCK]
            target = g_x[k * BLOCK : (k + 1) * BLOCK]
            g = gradient[(m * inputs + k) * BLOCK : (m * inputs + k + 1) * BLOCK]
            for p in range(BLOCK):
                target[p] += factor[p] * g[p]
                by_factor[p] += source[p] * g[p]


@subroutine()
def _multiply(x, rows, weights, columns, out):
    """Writes `columns` rows: sums of the `rows` rows of x times weights[row·columns + column].

    Rows and columns are taken in fours, so with sixteen weights at a time.
    """
    for j in range(0, columns, FOUR):
        o = out[j * BLOCK : (j + FOUR) * BLOCK]
        o[:] = ZERO
        for r in range(0, rows, FOUR):
            i = x[r * BLOCK : (r + FOUR) * BLOCK]
            w = weights[r * columns + j : (r + FOUR - 1) * columns + j + FOUR]
            a0, a1, a2, a3 = w[0], w[1], w[2], w[3]
            w = w[columns:]
            b0, b1, b2, b3 = w[0], w[1], w[2], w[3]
            w = w[columns:]
            c0, c1, c2, c3 = w[0], w[1], w[2], w[3]
            w = w[columns:]
            d0, d1, d2, d3 = w[0], w[1], w[2], w[3]
            for p in range(BLOCK):
                a, b, c, d = i[p], i[BLOCK + p], i[2 * BLOCK + p], i[3 * BLOCK + p]
                o[p] += a0 * a + b0 * b + c0 * c + d0 * d
                o[BLOCK + p] += a1 * a + b1 * b + c1 * c + d1 * d
                o[2 * BLOCK + p] += a2 * a + b2 * b + c2 * c + d2 * d
                o[3 * BLOCK + p] += a3 * a + b3 * b + c3 * c + d3 * d


@subroutine()
def _products(x, y, out, columns):
    """Adds the 16 inner products of four rows of x and four of y to a 4 × 4 part of a matrix.

    `out` begins at that part; the matrix has `columns` columns.
    """
    a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = ZERO
    c0 = c1 = c2 = c3 = d0 = d1 = d2 = d3 = ZERO
    for p in range(BLOCK):
        a, b, c, d = x[p], x[BLOCK + p], x[2 * BLOCK + p], x[3 * BLOCK + p]
        e, f, g, h = y[p], y[BLOCK + p], y[2 * BLOCK + p], y[3 * BLOCK + p]
        a0 += a * e
        a1 += a * f
        a2 += a * g
        a3 += a * h
        b0 += b * e
        b1 += b * f
        b2 += b * g
        b3 += b * h
        c0 += c * e
        c1 += c * f
        c2 += c * g
        c3 += c * h
        d0 += d * e
        d1 += d * f
        d2 += d * g
        d3 += d * h
    _add(out, a0, a1, a2, a3)
    _add(out[columns:], b0, b1, b2, b3)
    _add(out[2 * columns :], c0, c1, c2, c3)
    _add(out[3 * columns :], d0, d1, d2, d3)


@subroutine()
def _add(out, a, b, c, d):
    out[0] += a
    out[1] += b
    out[2] += c
    out[3] += d


@subroutine()
def _weight_gradients(x, rows, gradient, columns, out):
    """Adds inner products of each row of x and each of the gradient to out (rows·columns,)."""
    for r in range(0, rows, FOUR):
        for j in range(0, columns, FOUR):
            _products(x[r * BLOCK :], gradient[j * BLOCK :], out[r * columns + j :], columns)


@subroutine()
def _relu(rows):
    for i in range(rows.size):
        rows[i] = max(rows[i], ZERO)


@subroutine()
def _relu_backward(rows, gradient):
    for i in range(gradient.size):
        gradient[i] = gradient[i] if rows[i] > ZERO else ZERO


@kernel(parallel=True)
def forward(x, alpha, weights, layers, hidden, out):
    """Writes the outputs of all points, and the hidden rows, which `backward` needs.

    Args:
        x: (N, inputs) features.
        alpha: (N, sets) factors of the sets.
        weights: Matrices (blended rows, columns) of all layers, padded, flattened one after the
            other.
        layers: (layers, 4): for each layer the index of its first weight, its number of inputs, of
            padded blended rows, and of padded columns.
        hidden: (blocks, layers − 1, columns·BLOCK) hidden rows, written.
        out: (N, outputs), written.
    """
    blocks, sets, last = hidden.shape[0], alpha.shape[1], len(layers) - 1
    for part in numba.prange(PARTS):
        x_rows = np.empty(x.shape[1] * BLOCK, np.float32)
        alpha_rows = np.empty(sets * BLOCK, np.float32)
        blended = np.empty(layers[:, 2].max() * BLOCK, np.float32)
        out_rows = np.empty(layers[last, 3] * BLOCK, np.float32)
        for block in range(part * blocks // PARTS, (part + 1) * blocks // PARTS):
            _read(x, block * BLOCK, x_rows)
            _read(alpha, block * BLOCK, alpha_rows)
            source = x_rows
            for k in range(last + 1):
                first, inputs, rows, columns = layers[k]
                target = hidden[block, k] if k < last else out_rows
                _blend(source, inputs, alpha_rows, sets, blended[: rows * BLOCK])
                _multiply(blended, rows, weights[first:], columns, target)
                if k < last:
                    _relu(target)
                source = target
            _write(out_rows, block * BLOCK, out)


@kernel(parallel=True)
def backward(x, alpha, weights, layers, hidden, gradient, g_x, g_alpha, g_weights):
    """Gradients of `forward`.

    Args:
        x: (N, inputs), as given to `forward`.
        alpha: (N, sets), as given to `forward`.
        weights: The matrices of `forward`, each transposed: (columns, blended rows).
        layers: (layers, 4), as given to `forward`.
        hidden: Hidden rows, as `forward` wrote them.
        gradient: (N, outputs) gradient of the outputs.
        g_x: (N, inputs), written.
        g_alpha: (N, sets), written.
        g_weights: (PARTS, weights), added to; its sum over PARTS is the gradient of the weights, in
            the layout of `forward`.
    """
    blocks, sets, last = hidden.shape[0], alpha.shape[1], len(layers) - 1
    for part in numba.prange(PARTS):
        x_rows = np.empty(x.shape[1] * BLOCK, np.float32)
        alpha_rows = np.empty(sets * BLOCK, np.float32)
        by_alpha = np.empty(sets * BLOCK, np.float32)
        blended = np.empty(layers[:, 2].max() * BLOCK, np.float32)
        by_blended = np.empty(blended.size, np.float32)
        by_out = np.empty(layers[:, 3].max() * BLOCK, np.float32)
        by_x = np.empty(layers[:, 1].max() * BLOCK, np.float32)
        for block in range(part * blocks // PARTS, (part + 1) * blocks // PARTS):
            _read(x, block * BLOCK, x_rows)
            _read(alpha, block * BLOCK, alpha_rows)
            _read(gradient, block * BLOCK, by_out)
            by_alpha[:] = ZERO
            for k in range(last, -1, -1):
                first, inputs, rows, columns = layers[k]
                source = hidden[block, k - 1] if k > 0 else x_rows
                _blend(source, inputs, alpha_rows, sets, blended[: rows * BLOCK])
                _weight_gradients(blended, rows, by_out, columns, g_weights[part, first:])
                _multiply(by_out, columns, weights[first:], rows, by_blended)
                by_source = by_x[: inputs * BLOCK]
                _unblend(source, inputs, alpha_rows, sets, by_blended, by_source, by_alpha)
                if k > 0:
                    _relu_backward(source, by_source)
                    by_out[: by_source.size] = by_source
                    by_out[by_source.size :] = ZERO
            _write(by_x, block * BLOCK, g_x)
            _write(by_alpha, block * BLOCK, g_alpha)
