"""numba's compiler, which believes nothing that a file of the current folder says."""

from numba import njit
from numba.core import config

__all__ = ["config", "njit"]

# The folder may be a stranger's. What numba has read there as it was imported is dropped.
config._config_fname = ""  # type: ignore (not public)
config.reload_config()
