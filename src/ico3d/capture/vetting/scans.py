"""Counts the passes over a JPEG picture; a small file of thousands of them takes minutes."""

import re
from typing import BinaryIO

MOST_SCANS = 64
"""Passes over a picture: cameras and programs make at most a dozen."""
MOST_MARKS = 10_000
"""Segments of a picture; those with colour profiles and thumbnails have hundreds."""
PIECE = 1 << 12
"""Bytes that are read at once."""
_MARK = re.compile(rb"\xff[^\x00\x01\xd0-\xd7\xff]")
"""A mark that begins a segment, or ends the picture; others have no length, or are values."""
END, BEGIN, SCAN = 0xD9, 0xD8, 0xDA
"""Marks: of a picture's end and beginning, and of a pass over it."""
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_SEQUENTIAL = frozenset((0xC0, 0xC1))
"""Kinds of pictures that are decoded at once where the first pass has all colours."""


def has_many_scans(file: BinaryIO) -> bool:
    """Whether a JPEG picture has more than `MOST_SCANS` passes, or `MOST_MARKS` segments.

    It is read from its start to where they begin, and to its end only where there may be several.

    Args:
        file: The picture; other kinds have no passes. It stands somewhere else afterwards.
    """
    file.seek(0)
    if file.read(2) != b"\xff\xd8":
        return False
    scans = colours = 0
    for _ in range(MOST_MARKS):
        mark = next_mark(file)
        if mark in (None, END):
            return False
        if mark == BEGIN:
            continue
        length = int.from_bytes(file.read(2), "big")
        start = file.tell()
        if mark in _FRAMES:
            about = file.read(6)  # bits, height, width, colours
            colours = about[5] if mark in _SEQUENTIAL and len(about) == 6 else 0
        elif mark == SCAN:
            scans += 1
            if scans > MOST_SCANS:
                return True
            if scans == 1 and file.read(1) == bytes([colours]):
                return False
        file.seek(start + max(length - 2, 0))
    return True


def next_mark(file: BinaryIO) -> int | None:
    """The next mark of a JPEG picture; the file stands behind it. None where there is none."""
    last = b""
    while piece := file.read(PIECE):
        found = _MARK.search(last + piece)
        if found is not None:
            file.seek(found.end() - len(last) - len(piece), 1)
            return found[0][1]
        last = piece[-1:] if piece[-1:] == b"\xff" else b""
    return None
