"""Writes files so that a crash never leaves half of one; reads small ones of anybody."""

import errno
import json
import os
import re
import secrets
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

from ico3d.errors import StorageError

_TEMPORARY = re.compile(r"\..+\.[0-9a-f]{16}(\.[^.]+)?")
"""Names that `write_atomic` gives to unfinished files."""

MOST_NOTES = 64 << 20
"""Bytes of a file of JSON that `read_object` reads."""

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What a system says when a disk, a quota or the limit of a file's size is reached."""


def write_atomic(
    path: Path | str, write: Callable[[Path], None] | bytes, before: Path | None = None
) -> None:
    """Writes a file under a temporary name, flushes it to disk and renames it.

    Args:
        path: The file to write; its folder is made where missing.
        write: The contents, or a function that writes them to the temporary path it is given.
        before: Name that a file which was there before gets, once the new one is on the disk; None
            replaces it.

    Raises:
        StorageError: If the disk is full; a file that was there before is kept.
    """
    path = Path(path)
    # Not mkstemp: its files are readable by their owner only, and stay so after the rename.
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(8)}{path.suffix}")
    try:
        with full_disk(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(write, bytes):
                temporary.write_bytes(write)
            else:
                write(temporary)
            with temporary.open("rb") as file:
                os.fsync(file.fileno())
            if before is not None and path.exists():
                os.replace(path, before)
            os.replace(temporary, path)
            _sync_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def full_disk(path: Path) -> Generator[None]:
    """Makes one sentence of a disk that is full while `path` is written.

    Raises:
        StorageError: If it is.
    """
    try:
        yield
    except OSError as error:
        if error.errno not in FULL:
            raise
        raise StorageError.of(
            "disk-full",
            f"{path} cannot be written, as ",
            f" Run the same command again; what was there before is kept ({error.strerror}).",
        ) from error


def remove_unfinished(folder: Path) -> None:
    """Removes what killed writers left in a folder; call only while nobody writes there."""
    for path in folder.iterdir():
        if _TEMPORARY.fullmatch(path.name):
            path.unlink()


def read_object(file: Path) -> dict[str, Any]:
    """The object in a file of JSON, which may be anybody's; empty where there is none.

    Nothing is read that has no end, such as what a link to a device leads to.
    """
    try:
        if not file.is_file() or file.stat().st_size > MOST_NOTES:
            return {}
        content: object = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return cast(dict[str, Any], content) if isinstance(content, dict) else {}


def _sync_folder(folder: Path) -> None:
    """Makes renames in a folder last through a power cut."""
    if os.name != "posix":
        return  # elsewhere folders cannot be opened
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
