"""How kernels are compiled."""

from collections.abc import Callable

import numba

PARTS = 16
"""Work on many Gaussians is cut into so many parts, which threads share out."""


def kernel(parallel: bool = False) -> Callable:
    """A decorator that compiles a function without error checks and with fast float arithmetic.

    Division by zero gives infinity (a check would be a branch, and a branch in the innermost loop
    keeps LLVM from vectorising it).
    """
    return numba.njit(parallel=parallel, fastmath=True, error_model="numpy", nogil=True, cache=True)
