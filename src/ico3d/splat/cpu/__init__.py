"""The CPU rasteriser: numba kernels with analytic gradients behind torch autograd."""

from ico3d.common.native.jit import config

# The workqueue layer aborts when two Python threads start kernels; OpenMP and TBB do not.
config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]  # type: ignore (set at run time)
