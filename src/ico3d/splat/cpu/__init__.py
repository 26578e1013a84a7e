"""The CPU rasteriser: numba kernels with analytic gradients behind torch autograd."""

import numba

# The workqueue layer aborts when two Python threads start kernels; OpenMP and TBB do not.
numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]
