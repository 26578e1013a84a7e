"""Folders of recordings that appear once they are complete."""

import json
import os
import re
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ico3d.common import files
from ico3d.common.files import SPARE, write_atomic
from ico3d.common.people.stated import NOT_STATED
from ico3d.errors import CaptureError

UNFINISHED = "unfinished.json"
"""File of an unfinished folder that says of whom it is, from the first picture on."""
_HIDDEN = re.compile(r"\..+\.[0-9a-f]{8}", re.DOTALL)


def is_unfinished(name: str) -> bool:
    """Whether a folder's name is one of those that `new_folder` gives to unfinished ones."""
    return _HIDDEN.fullmatch(name) is not None


@contextmanager
def new_folder(
    out: Path, likeness: str = NOT_STATED, sources: Sequence[str] = ()
) -> Iterator[Path]:
    """A temporary folder that becomes `out` after the `with` block, or is removed if it raises.

    It says whose pictures it holds, so that these are found where the process is killed. What a
    killed process left of the same `out` is removed.

    Args:
        out: The folder to make.
        likeness: Whose likeness the recording is.
        sources: Data from which it is made.

    Raises:
        CaptureError: If `out` exists.
    """
    if os.path.exists(out):
        raise CaptureError(f"{out} exists already: remove it or choose another folder.")
    out.parent.mkdir(parents=True, exist_ok=True)
    _remove_left(out)
    work, lock = _begun(out)
    try:
        about = {"likeness": likeness, "sources": list(sources)}
        write_atomic(work / UNFINISHED, json.dumps(about).encode())
        yield work
        (work / UNFINISHED).unlink()
        work.rename(out)
    finally:
        files.remove_folder(work)
        os.close(lock)


def check_room(folder: Path, size: int) -> None:
    """Checks that a disk has room for what a stranger's files become, and some more.

    Args:
        folder: A folder on the disk.
        size: Bytes that are about to be written.

    Raises:
        CaptureError: If it has not.
    """
    free = shutil.disk_usage(folder).free
    if size + SPARE > free:
        raise CaptureError(
            f"{size / 1e9:.1f} GB are to be written to {folder.parent}, which has "
            f"{free / 1e9:.1f} GB left: make room, or name another folder."
        )


def check_left(folder: Path) -> None:
    """Checks that a disk has not become full while a folder of a recording is written.

    How much a video becomes is not known before it is read: pictures of noise take ten times as
    much as those of people.

    Raises:
        StorageError: If less than `SPARE` is left.
    """
    files.check_left(folder, folder.parent)


def _begun(out: Path) -> tuple[Path, int]:
    """A new folder beside `out`, and its lock, which ends with the process, however that ends."""
    while True:
        work = out.with_name(f".{out.name}.{secrets.token_hex(4)}")
        work.mkdir()  # not mkdtemp: who may read it is for the umask to say
        lock = files.locked_folder(work)
        if lock is not None and os.path.isdir(work):
            return work, lock
        if lock is not None:  # another process took it for a left one, before it was locked
            os.close(lock)


def _remove_left(out: Path) -> None:
    """Removes unfinished folders of `out` that no process holds."""
    for folder in out.parent.iterdir():
        if not is_unfinished(folder.name) or folder.name[1:-9] != out.name:
            continue
        lock = None if os.path.islink(folder) else files.locked_folder(folder)
        if lock is not None:
            files.remove_folder(folder)
            os.close(lock)
