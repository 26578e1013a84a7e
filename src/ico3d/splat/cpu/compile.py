"""The decorator that compiles numba kernels."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

PARTS = 16
"""Number of parts into which work on many Gaussians is cut; threads share the parts out."""


def kernel(parallel: bool = False, inline: bool = False) -> Callable[[Kernel], Kernel]:
    """A decorator that compiles a function without error checks and with fast float arithmetic.

    Division by zero gives infinity: a check would be a branch, which keeps LLVM from vectorising
    the innermost loop.

    Args:
        parallel: Whether threads share the function's `prange` loops.
        inline: Whether the function's code is inserted at its calls; meant for small functions that
            take many arrays, because numba passes an array as seven arguments.
    """
    compiled: Any = numba.njit(
        parallel=parallel,
        forceinline=inline,
        fastmath=True,
        error_model="numpy",
        nogil=True,
        cache=True,
    )
    return compiled
