"""Looks at the end of a zip archive of anybody before `zipfile` reads its directory whole."""

import os
import struct
from dataclasses import dataclass
from typing import BinaryIO

_END = struct.Struct("<4s4H2LH")
_FAR_END, _LOCATOR = struct.Struct("<4sQ2H2L4Q"), struct.Struct("<4sLQL")
MOST_ENTRIES, MOST_LENGTH = 10_000, 1 << 20
"""Entries of an archive, and bytes of its directory: an entry takes 400 bytes of memory."""


class OtherEndError(ValueError):
    """The file does not end as a plain archive does."""


@dataclass(frozen=True)
class Directory:
    """Where the directory of an archive is.

    Attributes:
        count: Number of its entries, as the archive states it; nobody goes by it.
        length: Bytes that are read as entries.
        start: Its first byte.
        end: Where the record begins that says all this.
        far: Whether that is the one of the format for large archives (zip64).
    """

    count: int
    length: int
    start: int
    end: int
    far: bool


def directory(file: BinaryIO) -> Directory:
    """Finds the directory of an archive; nothing may stand behind its end record.

    Raises:
        OtherEndError: If the file ends otherwise.
    """
    end = file.seek(0, os.SEEK_END) - _END.size
    if end < 0:
        raise OtherEndError("it is too short to be an archive")
    file.seek(end)
    signature, disk, first, here, count, length, start, comment = _END.unpack(file.read(_END.size))
    if signature != b"PK\5\6" or comment or disk or first or here != count:
        raise OtherEndError("it is no plain zip archive, or was cut off")
    found = _far(file, end) or Directory(count, length, start, end, far=False)
    file.seek(0)
    return found


def check_directory(file: BinaryIO) -> None:
    """Refuses an archive of more entries than any of arrays or weights has.

    Raises:
        ValueError: If it has more, its directory does not end where the record of its end begins,
            or the file ends otherwise than an archive.
    """
    found = directory(file)
    if found.count > MOST_ENTRIES or found.length > MOST_LENGTH:
        raise ValueError(f"it has more than {MOST_ENTRIES:,} entries")
    if found.start + found.length != found.end:  # some readers go by one, some by the other
        raise OtherEndError("its directory is not where it should be")


def _far(file: BinaryIO, end: int) -> Directory | None:
    """The directory as the record for large archives states it, if there is one.

    PyTorch always writes it. Readers look for it right before its locator or where that says.
    """
    if end < _FAR_END.size + _LOCATOR.size:
        return None
    place = end - _LOCATOR.size - _FAR_END.size
    file.seek(place)
    record = _FAR_END.unpack(file.read(_FAR_END.size))
    locator = _LOCATOR.unpack(file.read(_LOCATOR.size))
    if locator[0] != b"PK\6\7":
        return None
    if record[0] != b"PK\6\6" or locator[2] != place:
        raise OtherEndError("its directory is not where it should be")
    return Directory(*record[7:], end=place, far=True)
