"""The avatar that is part of the Python package."""

import os
from pathlib import Path

import ico3d
from ico3d.errors import BundleError

NAME = "demo"
"""Name of the packaged avatar, accepted wherever the path of a bundle is."""
FILE = Path(ico3d.__file__).parent / "chat" / "data" / "demo.ico3d"


def bundle_path(named: Path | str) -> Path:
    """Path of a bundle; `demo` stands for the packaged avatar.

    Raises:
        BundleError: If `demo` is asked for and this installation of the package lacks it.
    """
    if str(named) != NAME:
        return Path(named)
    if not os.path.isfile(FILE):
        raise BundleError(
            "this installation has no demo avatar (chat/data/demo.ico3d): "
            "make one with `ico3d bake` and serve it with `ico3d serve`."
        )
    return FILE
