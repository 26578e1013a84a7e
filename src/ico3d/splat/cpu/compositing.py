"""Putting a drawn picture over a background: one pass over the pixels each way."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.cpu.compile import PARTS, kernel

ONE = np.float32(1)


@kernel(parallel=True)
def put_over(image, alpha, behind, out):
    """Writes image + (1 − alpha)·behind.

    Args:
        image: (3·P,) colours of P pixels on black.
        alpha: (P,) share of the background that is hidden.
        behind: (3·P,) the background.
        out: (3·P,), written.
    """
    for part in numba.prange(PARTS):
        count = alpha.size
        for p in range(part * count // PARTS, (part + 1) * count // PARTS):
            light = ONE - alpha[p]
            for i in range(3 * p, 3 * p + 3):
                out[i] = image[i] + light * behind[i]


@kernel(parallel=True)
def put_over_backward(behind, gradient, by_alpha):
    """Writes the gradient (P,) of `put_over` by alpha; gradients are (3·P,)."""
    for part in numba.prange(PARTS):
        count = by_alpha.size
        for p in range(part * count // PARTS, (part + 1) * count // PARTS):
            total = gradient[3 * p] * behind[3 * p]
            total += gradient[3 * p + 1] * behind[3 * p + 1]
            by_alpha[p] = -total - gradient[3 * p + 2] * behind[3 * p + 2]
