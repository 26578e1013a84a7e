"""How kernels are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

PARTS = 16
"""Work on many Gaussians is cut into so many parts, which threads share out."""


def kernel(parallel: bool = False, inline: bool = False) -> Callable[[Kernel], Kernel]:
    """A decorator that compiles a function without error checks and with fast float arithmetic.

    Division by zero gives infinity (a check would be a branch, and a branch in the innermost loop
    keeps LLVM from vectorising it).

    Args:
        parallel: Whether threads share its `prange` loops.
        inline: Whether its code is put where it is called: for small functions of many arrays,
            each of which is seven arguments of a call.
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
