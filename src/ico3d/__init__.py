"""ico3d: photorealistic 3D Gaussian people that anyone can talk with."""

import os

__version__ = "0.1.0"

# onnxruntime reports to its maker from 1.29 on, under an identifier that it keeps; it looks here
# once, when it is loaded
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
# numba believes `.numba_config.yaml` of the current folder where a variable says nothing, and
# unpickles what it finds in the cache that the file names
os.environ.setdefault("NUMBA_CACHE_DIR", "")
os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", "")
