"""Numba kernels of the head's MLP: everything but the two large matrix products of its first layer.

Each kernel passes once over the Gaussians, in parts that do not depend on the number of threads.
"""

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.cpu.compile import PARTS, kernel

SLOPE = np.float32(0.01)
"""Slope of the leaky ReLU below 0."""
AXES = 3
ZERO, ONE, TWO = np.float32(0), np.float32(1), np.float32(2)


@kernel(parallel=True)
def gather(features, positions, sines, cosines, octaves, inputs):
    """Writes the MLP's inputs: features, positions, sines of all octaves, cosines of all octaves.

    Each octave's follow from those of the octave below by the formulas of the double angle.

    Args:
        features: (N, w) blended features.
        positions: (N, 3) in the head's box.
        sines: (N, 3) of the first octave.
        cosines: (N, 3) of the first octave.
        octaves: L.
        inputs: (N, at least w + 3 + 6·L), written; columns beyond get zeros.
    """
    width, half = features.shape[1], AXES * octaves
    for part in numba.prange(PARTS):
        count = positions.shape[0]
        for n in range(part * count // PARTS, (part + 1) * count // PARTS):
            source, row = features[n], inputs[n]
            for i in range(width):
                row[i] = source[i]
            waves = row[width + AXES :]
            waves[2 * half :] = ZERO
            for axis in range(AXES):
                row[width + axis] = positions[n, axis]
                sine, cosine = sines[n, axis], cosines[n, axis]
                for i in range(axis, half, AXES):
                    waves[i], waves[half + i] = sine, cosine
                    sine, cosine = TWO * sine * cosine, ONE - TWO * sine * sine


@kernel(parallel=True)
def activate(hidden, weight, bias, values):
    """The leaky ReLU, in place, and the last layer.

    Args:
        hidden: (N, H) the first layer's values; overwritten with their activations.
        weight: (V, H) of the last layer.
        bias: (V,) of the last layer.
        values: (N, V), written.
    """
    for part in numba.prange(PARTS):
        count = hidden.shape[0]
        for n in range(part * count // PARTS, (part + 1) * count // PARTS):
            row = hidden[n]
            for j in range(row.size):
                row[j] = max(row[j], SLOPE * row[j])
            for v in range(values.shape[1]):
                factors, total = weight[v], bias[v]
                for j in range(row.size):
                    total += row[j] * factors[j]
                values[n, v] = total


@kernel(parallel=True)
def activate_backward(hidden, weight, gradient, g_hidden, sums):
    """Gradients of `activate`.

    Args:
        hidden: (N, H) activations.
        weight: (V, H) of the last layer.
        gradient: (N, V) of the values.
        g_hidden: (N, H), written: gradient of what the leaky ReLU was applied to.
        sums: (PARTS, V + 1, H + 1) of zeros; gets, part by part, the gradient of the last layer's
            weights, beside them of its biases, and in the last row of the first layer's biases.
    """
    outputs, width = weight.shape
    for part in numba.prange(PARTS):
        count = hidden.shape[0]
        below = sums[part, outputs]
        for n in range(part * count // PARTS, (part + 1) * count // PARTS):
            row, out = hidden[n], g_hidden[n]
            for j in range(width):
                out[j] = ZERO
            for v in range(outputs):
                g, factors, by_factors = gradient[n, v], weight[v], sums[part, v]
                for j in range(width):
                    out[j] += g * factors[j]
                    by_factors[j] += g * row[j]
                by_factors[width] += g
            for j in range(width):
                out[j] *= ONE if row[j] > ZERO else SLOPE
                below[j] += out[j]


@kernel(parallel=True)
def scatter(g_inputs, inputs, rates, g_features, g_positions):
    """Gradients of `gather` by features and positions.

    Args:
        g_inputs: (N, at least w + 3 + 6·L) gradient of the inputs.
        inputs: The inputs that `gather` wrote.
        rates: (L,) angle per position, by octave.
        g_features: (N, w), written.
        g_positions: (N, 3), written.
    """
    width, half = g_features.shape[1], AXES * rates.size
    for part in numba.prange(PARTS):
        count = inputs.shape[0]
        for n in range(part * count // PARTS, (part + 1) * count // PARTS):
            gradient, target = g_inputs[n], g_features[n]
            for i in range(width):
                target[i] = gradient[i]
            waves, by_waves = inputs[n, width + AXES :], gradient[width + AXES :]
            for axis in range(AXES):
                total = gradient[width + axis]
                for octave in range(rates.size):
                    i = AXES * octave + axis
                    by_angle = by_waves[i] * waves[half + i] - by_waves[half + i] * waves[i]
                    total += rates[octave] * by_angle
                g_positions[n, axis] = total
