"""Numba kernels of the latent basis: blending, its gradients and rank-one steps.

All kernels take the basis as (R, S): R rows, one for each expression value and one for the bias,
and S = N·w numbers, w for each Gaussian. Work is cut into blocks of S that stay in the first-level
cache during the loop over the rows. Inner loops run over slices, because indexing `basis[row, i]`
there is four times slower.
"""

import numpy as np

from ico3d.common.native.jit import prange
from ico3d.splat.cpu.compile import kernel
from ico3d.training.optimiser import BETA1, BETA2, EPSILON

BLOCK = 2048
FOUR = 4
"""Rows that are blended at once: memory delivers several streams faster than one after another."""


@kernel(parallel=True)
def blend_rows(basis, weights, rows, out):
    """Writes Σ weights[r]·basis[r], summed over `rows`, to out (S,)."""
    fours = rows.size // FOUR * FOUR
    for block in prange((out.size + BLOCK - 1) // BLOCK):
        low, high = block * BLOCK, min((block + 1) * BLOCK, out.size)
        target = out[low:high]
        target[:] = 0
        for k in range(0, fours, FOUR):
            r0, r1, r2, r3 = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
            w0, w1, w2, w3 = weights[r0], weights[r1], weights[r2], weights[r3]
            b0, b1, b2, b3 = basis[r0], basis[r1], basis[r2], basis[r3]
            b0, b1, b2, b3 = b0[low:high], b1[low:high], b2[low:high], b3[low:high]
            for i in range(target.size):
                target[i] += w0 * b0[i] + w1 * b1[i] + w2 * b2[i] + w3 * b3[i]
        for k in range(fours, rows.size):
            weight, source = weights[rows[k]], basis[rows[k], low:high]
            for i in range(target.size):
                target[i] += weight * source[i]


@kernel(parallel=True)
def blend_some(basis, weights, rows, chosen, out):
    """As `blend_rows`, of some Gaussians: those numbered in `chosen`, to out (n, w)."""
    width = out.shape[1]
    together = BLOCK // width + 1
    for block in prange((chosen.size + together - 1) // together):
        low, high = block * together, min((block + 1) * together, chosen.size)
        out[low:high] = 0
        for r in rows:
            weight = weights[r]
            for n in range(low, high):
                source = basis[r, chosen[n] * width : (chosen[n] + 1) * width]
                target = out[n]
                for i in range(width):
                    target[i] += weight * source[i]


@kernel(parallel=True)
def row_products(basis, gradient, out):
    """Writes basis · gradient to out (R,), which is the gradient of the row weights."""
    for r in prange(basis.shape[0]):
        source = basis[r]
        total = np.float32(0)
        for i in range(source.size):
            total += source[i] * gradient[i]
        out[r] = total


@kernel(parallel=True)
def adam_rank_one(basis, first, second, weights, gradient, rows, steps, roots, pulls):
    """One Adam step, in place, with the gradient weights ⊗ gradient, which is never stored.

    Args:
        basis: (R, S).
        first: (R, S) first moments.
        second: (R, S) second moments.
        weights: (R,) row weights.
        gradient: (S,) gradient of the blended features.
        rows: Indices of the rows to update.
        steps: (R,) learning rate times the correction of the first moment.
        roots: (R,) correction of the root of the second moment.
        pulls: (R,) weight decay: factor by which each row is added to its gradient (L2).
    """
    beta1, beta2, epsilon = np.float32(BETA1), np.float32(BETA2), np.float32(EPSILON)
    rest1, rest2 = np.float32(1.0 - BETA1), np.float32(1.0 - BETA2)
    for block in prange((gradient.size + BLOCK - 1) // BLOCK):
        low, high = block * BLOCK, min((block + 1) * BLOCK, gradient.size)
        g = gradient[low:high]
        for r in rows:
            value, m, v = basis[r, low:high], first[r, low:high], second[r, low:high]
            weight, step, root, pull = weights[r], steps[r], roots[r], pulls[r]
            for i in range(g.size):
                d = weight * g[i] + pull * value[i]
                m[i] = beta1 * m[i] + rest1 * d
                v[i] = beta2 * v[i] + rest2 * d * d
                value[i] -= step * m[i] / (np.sqrt(v[i]) * root + epsilon)


@kernel(parallel=True)
def rmsprop_rank_one(basis, second, weights, gradient, rows, rates, roots, pulls, chosen):
    """One RMSProp step, in place, with the gradient weights ⊗ gradient, which is never stored.

    The w numbers of a Gaussian in a row share one second moment: the mean of their squares.

    Args:
        basis: (R, S).
        second: (R, N) second moments.
        weights: (R,) row weights.
        gradient: (n, w) gradient of the blended features of the chosen Gaussians.
        rows: Indices of the rows to update.
        rates: (R,) learning rates.
        roots: (R,) correction of the root of the second moment.
        pulls: (R,) weight decay: factor by which each row is added to its gradient (L2).
        chosen: (n,) numbers of the Gaussians to update.
    """
    count, width = gradient.shape
    beta2, epsilon = np.float32(BETA2), np.float32(EPSILON)
    share = np.float32((1.0 - BETA2) / width)
    together = BLOCK // width + 1
    for block in prange((count + together - 1) // together):
        for r in rows:
            weight, rate, root, pull = weights[r], rates[r], roots[r], pulls[r]
            for k in range(block * together, min((block + 1) * together, count)):
                n = chosen[k]
                g = gradient[k]
                value = basis[r, n * width : (n + 1) * width]
                total = np.float32(0)
                for i in range(width):
                    d = weight * g[i] + pull * value[i]
                    total += d * d
                v = beta2 * second[r, n] + share * total
                second[r, n] = v
                step = rate / (np.sqrt(v) * root + epsilon)
                for i in range(width):
                    value[i] -= step * (weight * g[i] + pull * value[i])
