"""Writing files so that a crash never leaves half of one, and finding model files."""

import os
import secrets
from collections.abc import Callable
from pathlib import Path

from ico3d.errors import MissingModelError


def write_atomic(path: Path | str, write: Callable[[Path], None] | bytes) -> None:
    """Writes a file by way of a temporary one: write, fsync, rename.

    Args:
        path: Where the file shall lie; its folder is made.
        write: The bytes, or a function that writes to the path it is given.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # Not mkstemp: its files are readable by their owner only, and stay so after the rename.
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(8)}{path.suffix}")
    try:
        if isinstance(write, bytes):
            temporary.write_bytes(write)
        else:
            write(temporary)
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def model_file(name: str, purpose: str) -> Path:
    """Finds a model file in `$ICO3D_MODELS` or the user's cache (`~/.cache/ico3d/models`).

    Raises:
        MissingModelError: If it lies in neither; the sentence says where to put it.
    """
    folders = [Path(p) for p in (os.environ.get("ICO3D_MODELS"),) if p]
    folders.append(Path.home() / ".cache" / "ico3d" / "models")
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    raise MissingModelError(
        f"{purpose} needs the model file '{name}': put it into {folders[-1]} "
        "or name its folder in the environment variable ICO3D_MODELS."
    )
