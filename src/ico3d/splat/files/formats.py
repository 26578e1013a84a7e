"""Reads and writes files of 3D Gaussians; formats are recognised by a file's contents."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.common.files import MOST_BYTES, check_left, check_regular, read_small, write_atomic
from ico3d.common.spz.container import GZIP_MAGIC, MAGIC
from ico3d.common.unpacking.memory import lacks_room
from ico3d.errors import GaussianFileError, SettingsError
from ico3d.splat.files import compressed_ply, ply, splat, spz, standard_ply
from ico3d.splat.files.raw import RawGaussians

_WRITERS = {".ply": standard_ply.write, ".spz": spz.write}
_HEAD_BYTES = 64 * 32
_TIMES = {"": 8, "splat": 12, "compressed": 16, "text": 24}
"""How many times its size a file takes at most while it is read and written in another format."""
_TIMES_OF_BYTES = 32
"""The same for a PLY whose numbers have one byte each; they become numbers of four."""


@dataclass(frozen=True)
class GaussianFile:
    """A file of Gaussians that was read.

    Attributes:
        kind: The format, in words.
        gaussians: The Gaussians; all values are finite.
    """

    kind: str
    gaussians: RawGaussians


def read_gaussians(path: Path | str) -> RawGaussians:
    """Reads a file of 3D Gaussians: PLY (standard or compressed), SPZ or .splat.

    Raises:
        GaussianFileError: If the file is missing or damaged, or a value is not finite.
        MissingExtraError: If the file is SPZ version 4 and zstandard is not installed.
    """
    return read_file(path).gaussians


def read_file(path: Path | str) -> GaussianFile:
    """Reads a file of 3D Gaussians and names its format; errors as for `read_gaussians`."""
    path = Path(path)
    try:
        check_regular(path)
        with path.open("rb") as file:
            head = file.read(ply.MAX_HEADER_BYTES)
        kind = _recognise(head[:_HEAD_BYTES], path)
        if lacking := lacks_room(path, _times(kind, head)):
            raise GaussianFileError(f"it {lacking}")
        data = read_small(path, most=MOST_BYTES)
        named, gaussians = _read(kind, data)
        return GaussianFile(named, gaussians.checked())
    except OSError as error:
        raise GaussianFileError(f"{path}: cannot be read ({error.strerror}).") from None
    except GaussianFileError as error:
        raise GaussianFileError(f"{path}: {error}.") from None


def _recognise(head: bytes, path: Path) -> str:
    """The kind of a file by its first bytes; a `.splat` has no mark, so its name counts too."""
    if head[:4] in (b"ply\n", b"ply\r"):
        return "ply"
    if head[:2] == GZIP_MAGIC or head[:4] == MAGIC:
        return "spz"
    if path.suffix == ".splat" or splat.looks_like(head, path.stat().st_size):
        return "splat"
    raise GaussianFileError(
        "no 3D Gaussians that ico3d can read: at byte 0 begins neither PLY nor SPZ nor .splat"
    )


def _times(kind: str, head: bytes) -> int:
    """How many times its size a file of a kind takes, by its first bytes."""
    if kind != "ply":
        return _TIMES.get(kind, _TIMES[""])
    header = ply.parse_header(head)
    if not header.order:
        return _TIMES["text"]
    columns = [kind for element in header.elements.values() for kind in element.properties.values()]
    if any(compressed_ply.PACKED[0] in element.properties for element in header.elements.values()):
        return _TIMES["compressed"]
    size = sum(np.dtype(column).itemsize for column in columns)
    return max(_TIMES[""], -(-_TIMES_OF_BYTES * len(columns) // max(size, 1)))


def _read(kind: str, data: bytes) -> tuple[str, RawGaussians]:
    """Format in words and contents of a file of a kind."""
    if kind == "spz":
        return "SPZ", spz.read(data)
    if kind == "splat":
        return ".splat", splat.read(data)
    header = ply.parse_header(data)
    tables = ply.read_tables(data, header)
    if "vertex" not in tables:
        raise GaussianFileError("the PLY has no table 'vertex' that Gaussians could be in")
    if compressed_ply.PACKED[0] in (tables["vertex"].dtype.names or ()):
        return "compressed PLY", compressed_ply.read(tables)
    return "PLY", standard_ply.read(tables["vertex"])


def check_writable(path: Path) -> None:
    """Checks, before long work, that `write_gaussians` knows the format of a file name.

    Raises:
        SettingsError: If the name does not end in .ply or .spz.
    """
    if path.suffix.lower() not in _WRITERS:
        raise SettingsError(f"{path}: ico3d writes Gaussians to files named .ply or .spz.")


def write_gaussians(path: Path | str, gaussians: RawGaussians) -> None:
    """Writes .ply (lossless) or .spz (small) by the file's suffix, atomically.

    Raises:
        SettingsError: If the name has another suffix.
        GaussianFileError: If a value is not finite, or the file cannot be written.
        StorageError: If the disk has no room for them and some more; a file of holes takes none.
    """
    path = Path(path)
    check_writable(path)
    write = _WRITERS[path.suffix.lower()]
    gaussians.checked()

    def written(temporary: Path) -> None:
        check_left(temporary.parent, path, gaussians.nbytes)
        write(gaussians, temporary)

    try:
        write_atomic(path, written)
    except OSError as error:
        raise GaussianFileError(f"{path}: cannot be written ({error.strerror}).") from None
