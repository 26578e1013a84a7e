"""Reads the arrays of an .npz file, which may unpack to a thousand times its size."""

import math
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.common.files import check_regular
from ico3d.common.unpacking import npy
from ico3d.common.unpacking.zips import check_directory

DAMAGED = (*npy.DAMAGED, zipfile.BadZipFile, zlib.error)
"""What numpy and zipfile raise for damaged files."""
WIDTH = 8
"""Bytes that a number counts at least: what is stored in one becomes a float64."""


class TooLargeError(ValueError):
    """The arrays of a file are larger than is taken."""


class LackingError(ValueError):
    """A file lacks arrays; the text is their names."""


def read_npz(file: Path, most: int, names: Iterable[str] | None = None) -> dict[str, Any]:
    """Reads arrays of a file; what is pickled is not opened.

    Args:
        file: An .npz file of anybody.
        most: Bytes that these arrays may take, as numbers of 64 bits.
        names: Which arrays; None for all.

    Returns:
        The arrays by name.

    Raises:
        TooLargeError: If they would take more; none is unpacked then.
        LackingError: If one is missing.
        ValueError: If the file is damaged.
        OSError: If it cannot be read.
    """
    check_regular(file)
    try:
        with file.open("rb") as opened:
            check_directory(opened)
            with zipfile.ZipFile(opened) as archive:
                members = _members(archive, names)
                if sum(_size(archive, member) for member in members.values()) > most:
                    raise TooLargeError("its arrays are larger than is taken")
                return {name: _array(archive, member) for name, member in members.items()}
    except (TooLargeError, LackingError):
        raise
    except DAMAGED as error:
        raise ValueError(f"it is damaged ({error})") from error


def _members(archive: zipfile.ZipFile, names: Iterable[str] | None) -> dict[str, zipfile.ZipInfo]:
    """The parts of the file in which arrays are, by the names of these."""
    found = {one.filename: one for one in archive.infolist() if one.filename.endswith(".npy")}
    wanted = [name.removesuffix(".npy") for name in found] if names is None else list(names)
    if lacking := [name for name in wanted if f"{name}.npy" not in found]:
        raise LackingError(", ".join(lacking))
    return {name: found[f"{name}.npy"] for name in wanted}


def _size(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> int:
    """Bytes that an array would take, as its head tells."""
    with archive.open(member) as stream:
        shape, _, kind = npy.array_head(stream)
        left = member.file_size - stream.tell()
    if math.prod(shape) * kind.itemsize > left:  # numpy would take memory for it first
        raise ValueError(f"{member.filename} claims more than it holds")
    return math.prod(shape) * max(kind.itemsize, WIDTH)


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Any:
    with archive.open(member) as stream:
        return np.lib.format.read_array(stream, allow_pickle=False)
