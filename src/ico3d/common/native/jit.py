"""numba's compiler, which believes nothing that a file of the current folder says.

The folder may be a stranger's, and what numba reads there as it is imported may name files to write
and to unpickle, or be gigabytes. Without a reader of YAML it reads nothing.
"""

from ico3d.common.native.hidden import hidden

with hidden("yaml"):
    import numba
    from numba import njit, prange
    from numba.core import config
    from numba.extending import register_jitable

config._config_fname = ""  # type: ignore (not public); it looks again before it compiles

__all__ = ["config", "njit", "numba", "prange", "register_jitable"]
