"""The decorators that compile numba kernels and what they call."""

from collections.abc import Callable
from typing import Any, TypeVar

from ico3d.common.native.jit import numba, register_jitable

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

PARTS = 16
"""Number of parts into which work on many Gaussians is cut; threads share the parts out."""


def kernel(parallel: bool = False, fast: bool = True) -> Callable[[Kernel], Kernel]:
    """A decorator that compiles a function that Python calls, without error checks.

    Division by zero gives infinity: a check would be a branch, which keeps LLVM from vectorising
    the innermost loop. No wrapper for calls from C is compiled.

    Args:
        parallel: Whether threads share the function's `prange` loops.
        fast: Whether sums may be taken in another order than written.
    """
    jit: Any = numba.njit  # its types leave an option out
    return jit(
        parallel=parallel,
        fastmath=fast,
        error_model="numpy",
        nogil=True,
        cache=True,
        no_cfunc_wrapper=True,
    )


def subroutine(inline: bool = False, fast: bool = True) -> Callable[[Kernel], Kernel]:
    """A decorator that lets kernels call a function; Python that calls it runs it uncompiled.

    It is compiled with the kernels that call it and lies in their cache entries. As a kernel, a
    small one would take about twice as long, for wrappers that unpack arguments of Python and C,
    and for an entry of its own. Python runs integers that overflow otherwise than kernels do.

    Args:
        inline: Whether the function's code is inserted at its calls; meant for small functions that
            take many arrays, because numba passes an array as seven arguments.
        fast: Whether sums may be taken in another order than written.
    """
    register: Any = register_jitable
    return register(
        forceinline=inline,
        fastmath=fast,
        error_model="numpy",
        no_cfunc_wrapper=True,
    )
