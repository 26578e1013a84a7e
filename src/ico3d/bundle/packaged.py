"""The avatar that comes in the package."""

from pathlib import Path

import ico3d
from ico3d.errors import BundleError

NAME = "demo"
"""How it is called wherever a bundle is taken."""
FILE = Path(ico3d.__file__).parent / "chat" / "data" / "demo.ico3d"


def bundle_path(named: Path | str) -> Path:
    """Where a bundle lies that somebody named: `demo` is the packaged one, all else a path.

    Raises:
        BundleError: If the packaged one is asked for and the package came without it.
    """
    if str(named) != NAME:
        return Path(named)
    if not FILE.is_file():
        raise BundleError(
            "this installation has no demo avatar (chat/data/demo.ico3d): "
            "make one with `ico3d bake` and serve it with `ico3d serve`."
        )
    return FILE
