"""Writes files so that a crash never leaves half of one; finds and reads small ones of anybody."""

import errno
import fcntl
import itertools
import os
import re
import secrets
import shutil
import stat
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, cast

from ico3d.common.typed import loose_json
from ico3d.errors import StorageError

_TEMPORARY = re.compile(r"\..+\.[0-9a-f]{16}(\.[^.]+)?")
"""Names that `write_atomic` gives to unfinished files."""

MOST_NOTES = 64 << 20
"""Bytes of a file that `read_small` reads."""

MOST_ABOUT = 16 << 20
"""Bytes of a file of JSON that says what a folder is; parsed it takes up to forty times as much."""

MOST_BYTES = 4 << 30
"""Bytes of a large file, such as a table of points, that `read_small` reads where it is told to."""

LONGEST = 3_500
"""Characters of a path below which `walk` looks: systems end at 4,096 bytes, names of files too."""

SPARE = 1 << 28
"""Bytes of a disk that stay free where it is not known before how much is going to be written."""

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
            if before is not None and os.path.exists(path):
                os.replace(path, before)
            os.replace(temporary, path)
            _sync_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def write_one_of_many(
    path: Path,
    write: Callable[[Path], None] | bytes,
    size: int = 0,
    before: Path | None = None,
) -> None:
    """Writes a file as `write_atomic`, of as many or as large as a stranger's files may ask for.

    Args:
        path: The file to write; its folder is made where missing.
        write: As for `write_atomic`.
        size: Bytes that a function will write, where that is known.
        before: As for `write_atomic`.

    Raises:
        StorageError: If less than these and `SPARE` bytes of the disk are left, or it is full.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    check_left(path.parent, path, len(write) if isinstance(write, bytes) else size)
    write_atomic(path, write, before)


def check_left(folder: Path, written: Path, size: int = 0) -> None:
    """Checks that a disk has not become full while what comes from a stranger is written.

    Args:
        folder: A folder on the disk.
        written: What the error calls that which cannot be written.
        size: Bytes that are about to be written, where that is known.

    Raises:
        StorageError: If less than these and `SPARE` are left.
    """
    if shutil.disk_usage(folder).free < size + SPARE:
        raise StorageError.of(
            "disk-full", f"{written} cannot be written, as ", " Run the same command again."
        )


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
        if _TEMPORARY.fullmatch(path.name) and (os.path.islink(path) or os.path.isfile(path)):
            path.unlink()


def read_object(file: Path) -> dict[str, Any]:
    """The object in a file of JSON, which may be anybody's; empty where there is none.

    One of more than `MOST_ABOUT` bytes counts as none.
    """
    try:
        content = json_of(file, most=MOST_ABOUT)
    except (OSError, ValueError):
        return {}
    return cast(dict[str, Any], content) if isinstance(content, dict) else {}


def json_of(file: Path, links: bool = True, most: int | None = None) -> Any:
    """What a file of JSON holds, which may be anybody's; `links` and `most` as for `read_small`.

    Raises:
        OSError: If it is not there, no regular file, or too large.
        ValueError: If it is no JSON in UTF-8, or nested too deep.
    """
    return loose_json(read_small(file, links, most))


def read_small(file: Path, links: bool = True, most: int | None = None) -> bytes:
    """The content of a small file, which may be anybody's.

    Nothing is read that has no end, such as what a link to a device leads to, and nobody waits for
    a pipe.

    Args:
        file: The file.
        links: Whether it may be a link to a file.
        most: Bytes that are read; None for `MOST_NOTES`.

    Raises:
        OSError: If it is not there, no regular file, or larger than `most`.
    """
    most = MOST_NOTES if most is None else most
    how = 0 if links else getattr(os, "O_NOFOLLOW", 0)
    how |= os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with open(os.open(file, how), "rb") as opened:
        about = os.fstat(opened.fileno())
        if not stat.S_ISREG(about.st_mode) or about.st_size > most:
            raise OSError(errno.EINVAL, "it is no small file", str(file))
        return opened.read(about.st_size)  # room for as many bytes is made at once


def resolved(path: Path) -> Path:
    """As `Path.resolve`, but of anybody's links: one that cannot be followed ends where it is.

    There are chains of thousands of links, circles, and links that only their owner may read.
    """
    try:
        return Path(os.path.realpath(path))
    except (OSError, RecursionError):
        return Path(os.path.abspath(path))


def holds(file: Path, content: bytes) -> bool:
    """Whether a file, which may be anybody's, holds exactly this; False if there is none."""
    if not os.path.isfile(file) or file.stat().st_size != len(content):
        return False
    return file.read_bytes() == content


def check_regular(file: Path) -> None:
    """Refuses what is there and no regular file: a pipe is waited for, and a device has no end.

    For files that a library opens by their paths; `read_small` sees to it itself.

    Raises:
        OSError: If it is none.
    """
    if os.path.exists(file) and not os.path.isfile(file):
        raise OSError(f"{file} is no regular file")


def first_entries(folder: Path, most: int) -> list[os.DirEntry[str]]:
    """The first entries of a folder, which may be anybody's; none where it cannot be listed."""
    try:
        with os.scandir(folder) as entries:
            return list(itertools.islice(entries, most))
    except OSError:
        return []


def own_file(file: Path) -> IO[bytes]:
    """A file that is kept open to be written, made where there is none.

    Raises:
        OSError: If it is a link, which may lead to any file of this machine, or a pipe.
    """
    if not os.path.islink(file):
        check_regular(file)
    return open(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW, 0o666), "wb")


def locked_folder(folder: Path) -> int | None:
    """An open folder that this process alone has locked, until it is closed or the process ends.

    Where a file system knows no locks, nothing is locked.

    Args:
        folder: No link.

    Returns:
        A descriptor; None where another process holds it, or there is no such folder.
    """
    try:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        return None
    except OSError:
        pass
    return lock


def remove_folder(folder: Path) -> OSError | None:
    """Removes a folder, which may be anybody's: deep, crowded, or not to be written.

    Names of one folder at each depth are all that it remembers.

    Args:
        folder: No link.

    Returns:
        The first thing that went wrong where something is left; what vanishes meanwhile is no
        fault.
    """
    faults: list[OSError] = []
    trail = [(os.fspath(folder), _names(folder, faults))]
    while trail:
        place, names = trail[-1]
        if not names:
            with _first(faults):
                os.rmdir(place)
            trail.pop()
            continue
        path = os.path.join(place, names.pop())
        with _first(faults):
            if not stat.S_ISDIR(os.lstat(path).st_mode):
                os.unlink(path)
            elif len(trail) == 1 or len(os.fsencode(path)) < LONGEST:
                trail.append((path, _names(path, faults)))
            else:  # from where it is too deep it is moved up, which only who may write there does
                with suppress(OSError):
                    os.chmod(path, stat.S_IRWXU)
                higher = secrets.token_hex(8)
                os.rename(path, os.path.join(folder, higher))
                trail[0][1].append(higher)
    return faults[0] if faults and os.path.lexists(folder) else None


def _names(folder: Path | str, faults: list[OSError]) -> list[str]:
    """What lies in a folder, which can be removed from it from now on."""
    with suppress(OSError):  # of another user; it may go nevertheless
        os.chmod(folder, stat.S_IRWXU)
    with _first(faults):
        return os.listdir(folder)
    return []


@contextmanager
def _first(faults: list[OSError]) -> Generator[None]:
    """Notes the first thing that goes wrong, and goes on."""
    try:
        yield
    except FileNotFoundError:
        pass
    except OSError as error:
        if not faults:
            faults.append(error)


def walk(folder: Path) -> Iterator[tuple[Path, list[str], list[str]]]:
    """As `os.walk`, from above, but without an end of Python's stack in folders of anybody."""
    waiting = [os.fspath(folder)]
    while waiting:
        place = waiting.pop()
        folders: list[str] = []
        files: list[str] = []
        try:
            with os.scandir(place) as entries:
                for entry in entries:
                    (folders if _is_folder(entry) else files).append(entry.name)
        except OSError:  # not ours to read, or gone
            continue
        yield Path(place), folders, files
        below = (os.path.join(place, name) for name in reversed(folders))
        waiting += [
            path for path in below if len(os.fsencode(path)) < LONGEST and not os.path.islink(path)
        ]


def _is_folder(entry: os.DirEntry[str]) -> bool:
    """Whether an entry is a folder, or a link to one; a link in a circle is none."""
    try:
        return entry.is_dir()
    except OSError:
        return False


def _sync_folder(folder: Path) -> None:
    """Makes renames in a folder last through a power cut."""
    if os.name != "posix":
        return  # elsewhere folders cannot be opened
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
