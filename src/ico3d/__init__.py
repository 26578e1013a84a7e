"""ico3d: photorealistic 3D Gaussian people that anyone can talk with."""

import os

from ico3d.common.native.plotting import guard

__version__ = "0.1.0"

# onnxruntime reports to its maker from 1.29 on, under an identifier that it keeps; it looks here
# once, when it is loaded
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
# where another library imports numba before `common/native/jit.py` does, it believes a file of the
# current folder, and unpickles what it finds in the cache that the file names; not beside these
os.environ.setdefault("NUMBA_CACHE_DIR", "")
os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", "")
os.environ.setdefault("NUMBA_CHROME_TRACE", "")

# OpenCV puts its folders and a colon before what this says. Behind a colon nothing is the current
# folder, from which all processes that are started later would load libraries.
_libraries = [folder for folder in os.environ.get("LD_LIBRARY_PATH", "").split(":") if folder]
_none = os.path.join(os.path.dirname(__file__), "no-libraries")
os.environ["LD_LIBRARY_PATH"] = ":".join(_libraries or [_none])

# PyAV's library for TLS looks for its settings in /tmp/vendor, where its wheel was built and where
# anybody may put a pipe, which is waited for whenever PyAV is imported
os.environ.setdefault("GNUTLS_SYSTEM_PRIORITY_FILE", os.devnull)

guard()
