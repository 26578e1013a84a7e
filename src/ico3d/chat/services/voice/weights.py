"""Where the files of a voice lie."""

import os
from pathlib import Path

from ico3d.errors import MissingModelError


def weights_folder(name: str, given: str = "") -> Path:
    """The folder of a voice's weights: the given one, or where `ico3d weights` keeps them."""
    if given:
        return Path(given).expanduser()
    return cache_folder() / "weights" / name


def cache_folder() -> Path:
    """What this user's programs have fetched or made and can make again."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "ico3d"


def require_files(name: str, *paths: Path) -> None:
    """Checks that weights are there; nothing is downloaded while somebody waits for an answer.

    Raises:
        MissingModelError: If one is missing.
    """
    for path in paths:
        if not path.is_file():
            raise MissingModelError(
                f"{path} is missing: fetch it with `ico3d weights fetch {name}`."
            )
