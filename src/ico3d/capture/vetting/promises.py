"""Counts what the tables of MP4 and QuickTime files promise, before FFmpeg opens such a file.

FFmpeg makes room for each sample that a table promises, and a table can promise 60 million of them
in four bytes: a file of 658 bytes takes gigabytes while it is opened. Tables are looked for by
their names, wherever FFmpeg may find one: its rules of what may lie in what are loose. Video files
of other kinds need bytes for what they promise.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ico3d.common.files import check_regular
from ico3d.errors import CaptureError

FIRST = frozenset(
    b"ftyp styp moov moof sidx mdat wide free skip junk pnot udta uuid pict ediw prfl".split()
)
"""Names of boxes with which files begin that FFmpeg takes for MP4 or QuickTime."""
OPAQUE = frozenset(b"mdat wide skip junk uuid pnot ftyp styp prft emsg inst".split())
"""Outer boxes in which FFmpeg looks for no tables."""
TRACK, HANDLER, EDITS = b"trak", b"hdlr", b"elst"
TIMES, CHUNKS, PACKED = b"stts", b"stsc", b"cmov"
SIZES, OFFSETS, ITEMS = (b"stsz", b"stz2"), (b"stco", b"co64"), (b"iloc", b"iinf")
PIECES = (b"trun", b"senc", b"saiz")
TABLES = (TRACK, HANDLER, EDITS, TIMES, CHUNKS, PACKED, *SIZES, *OFFSETS, *ITEMS, *PIECES)
"""Names of boxes that are looked for."""
MOST_TRACKS = 32
MOST_EDITS = 64
"""Stretches of a track that are played one after the other; each may copy all of its samples."""
MOST_SAMPLES = 1 << 23
"""Pictures and packets of sound: 1,000 a second for two hours; each takes some forty bytes."""
BLOCK = 1024
"""Samples of uncompressed sound that FFmpeg takes together, within a chunk."""
MOST_ITEMS = 1 << 16
"""Still pictures and their parts, which films do not have."""
MOST_BOXES = 1 << 20
"""Outer boxes: 30 pictures a second for two hours, each in boxes of its own, are 432,000."""
MOST_TABLES = 10_000
"""Names of tables in one outer box."""
MOST_BYTES = 128 << 20
"""Bytes in which tables are looked for; those of two hours take 10 MB."""
BEYOND = 32
"""Bytes behind a box that FFmpeg reads, where a table at its end is cut off."""


class _Broken(Exception):
    """A file promises what it cannot keep."""


@dataclass
class _Track:
    """What is promised from the name of one track to that of the next."""

    samples: int = 0
    times: list[np.ndarray] = field(default_factory=list)  # (E, 2) each: how many, how long
    chunks: list[np.ndarray] = field(default_factory=list)  # (E, 3) each: first, samples, kind
    offsets: int = 0
    edits: int = 0
    kinds: list[bytes] = field(default_factory=list)

    @property
    def promised(self) -> float:
        """Samples, by whichever table promises most of them."""
        times = sum(entries[:, 0].sum() for entries in self.times)
        # FFmpeg believes the lengths of chunks where each sample lasts one tick.
        ticks = any(len(entries) == 1 and entries[0, 1] == 1 for entries in self.times)
        chunks = sum(self._in_chunks(entries) for entries in self.chunks) if ticks else 0
        return max(self.samples, float(times), chunks)

    @property
    def copied(self) -> float:
        """Samples or blocks, with the copies that FFmpeg makes of them for edits."""
        blocks = self.offsets + self.promised / BLOCK
        return (blocks if self.is_plain_sound else self.promised) * max(self.edits, 1)

    @property
    def is_plain_sound(self) -> bool:
        """Whether it is uncompressed sound, for which FFmpeg makes room by blocks of chunks."""
        single = len(self.times) == 1 and len(self.times[0]) == 1 and self.times[0][0, 1] == 1
        return single and b"soun" in self.kinds and b"vide" not in self.kinds

    def _in_chunks(self, entries: np.ndarray) -> float:
        """Samples in chunks (E, 3); an entry holds for all chunks up to that of the next one."""
        firsts = np.append(entries[:, 0], self.offsets + 1)  # (E + 1,)
        runs = np.maximum(np.diff(firsts), 0)  # (E,)
        if (np.diff(entries[:, 0]) < 0).any():
            raise _Broken
        # Floats, as whole numbers would begin anew; the last chunk may hold less than it says.
        return float((runs * entries[:, 1]).sum()) - float(entries[-1:, 1].sum())


def check_promises(path: Path) -> bool:
    """Refuses an MP4 or QuickTime file whose tables promise more than the file can hold.

    Args:
        path: A file of anybody.

    Returns:
        Whether it is an MP4 or QuickTime file; nothing is said of others.

    Raises:
        CaptureError: If it has more samples than bytes, or more tracks, samples, still pictures or
            boxes than films have, or a compressed table of contents.
        OSError: If it cannot be read, or is no regular file.
    """
    check_regular(path)
    with path.open("rb") as file:
        if file.read(8)[4:] not in FIRST:
            return False
        try:
            _check(file, os.fstat(file.fileno()).st_size)
        except _Broken as error:
            text = " (Its tables promise more than the file can hold.)"
            raise CaptureError.of("decoding", f"{path}: ", text) from error
    return True


def _check(file: BinaryIO, size: int) -> None:
    """Looks at all outer boxes of a file.

    Raises:
        _Broken: If it promises too much.
    """
    tracks = [_Track()]
    pieces = items = read = 0
    for start, kind, body, end in _all_boxes(file, size):
        if kind in OPAQUE or not kind.isalnum() or _is_free(file, kind, body):
            continue
        read += end - start
        if read > MOST_BYTES:
            raise _Broken
        more = _count(_content(file, start, end), end - start, tracks)
        pieces, items = pieces + more[0], items + more[1]
    every = pieces + sum(track.promised for track in tracks)
    made = pieces + sum(track.copied for track in tracks)
    if every > size or made > MOST_SAMPLES or items > MOST_ITEMS:
        raise _Broken


def _all_boxes(file: BinaryIO, size: int) -> Iterator[tuple[int, bytes, int, int]]:
    """The outer boxes from the start of a file, and from where an index says that pieces begin.

    FFmpeg jumps there, and an index may lead into pictures, in which nobody looks for tables.
    """
    waiting, seen = [0], set[int]()
    while waiting:
        for start, kind, body, end in _boxes(file, size, waiting.pop()):
            if start in seen:
                break  # and all behind it
            seen.add(start)
            if len(seen) > MOST_BOXES:
                raise _Broken
            if kind == b"sidx":
                waiting += _targets(_content(file, start, end), body - start, end)
            yield start, kind, body, end


def _boxes(file: BinaryIO, size: int, at: int) -> Iterator[tuple[int, bytes, int, int]]:
    """Start, name, start of the content and end of boxes behind each other, as FFmpeg reads them.

    Args:
        file: The file.
        size: Its size in bytes.
        at: Start of the first box.
    """
    while at + 8 <= size:
        file.seek(at)
        head = file.read(16)
        length, body = int.from_bytes(head[:4], "big"), at + 8
        if length == 1 and at + 16 <= size:
            length, body = int.from_bytes(head[8:], "big", signed=True) - 8, at + 16
        length = length - 8 if length else size - body
        if length < 0:
            return
        end = min(body + length, size)
        yield at, head[4:8], body, end
        at = end


def _content(file: BinaryIO, start: int, end: int) -> bytes:
    """A box, and what is read behind it.

    Raises:
        _Broken: If it is larger than any that has tables.
    """
    if end - start > MOST_BYTES:
        raise _Broken
    file.seek(start)
    return file.read(end - start + BEYOND)


def _is_free(file: BinaryIO, kind: bytes, body: int) -> bool:
    """Whether a box is free space; FFmpeg looks there for nothing but a table of contents."""
    if kind not in (b"free", b"hoov"):
        return False
    file.seek(body + 4)
    return file.read(4) not in (b"mvhd", PACKED)


def _targets(data: bytes, at: int, end: int) -> set[int]:
    """Where the pieces begin that an index names; its content begins `at`, and ends at `end`."""
    wide = data[at : at + 1] > b"\0"
    target = end + _number(data, at + (20 if wide else 16), 8 if wide else 4)
    at += 28 if wide else 20
    found = set[int]()
    for place in range(at + 4, at + 4 + 12 * _number(data, at + 2, 2), 12):
        found.add(target)
        target += _number(data, place) & 0x7FFFFFFF
    return found


def _count(data: bytes, length: int, tracks: list[_Track]) -> tuple[int, int]:
    """Adds to the tracks what the tables of an outer box promise, in their order.

    Args:
        data: The box, and what is read behind it.
        length: Length of the box.
        tracks: Those so far; what is promised belongs to the last.

    Returns:
        Number of samples in pieces of films, and of still pictures.
    """
    pieces = items = 0
    for at, name in _named(data, length):
        body, track = at + 4, tracks[-1]
        if name == PACKED:
            raise _Broken
        if name == TRACK:
            tracks.append(_Track())
            if len(tracks) > MOST_TRACKS + 1:
                raise _Broken
        elif name == HANDLER:
            track.kinds.append(data[body + 8 : body + 12])
        elif name == EDITS:
            track.edits += _number(data, body + 4)
            if track.edits > MOST_EDITS:
                raise _Broken
        elif name in SIZES:
            track.samples += _number(data, body + 8)
        elif name == TIMES:
            track.times.append(_entries(data, body + 4, 2))
        elif name == CHUNKS:
            track.chunks.append(_entries(data, body + 4, 3))
        elif name in OFFSETS:
            track.offsets += _number(data, body + 4)
        elif name in ITEMS:
            items += _items(data, body, name)
        else:
            pieces += _samples(data, body, name)
    return pieces, items


def _named(data: bytes, length: int) -> list[tuple[int, bytes]]:
    """Where names of tables stand in a box, in order."""
    found = []
    for name in TABLES:
        at = data.find(name, 0, length)
        while at >= 0:
            found.append((at, name))
            if len(found) > MOST_TABLES:
                raise _Broken
            at = data.find(name, at + 1, length)
    return sorted(found)


def _number(data: bytes, at: int, width: int = 4) -> int:
    """A number of a table."""
    return int.from_bytes(data[at : at + width], "big")


def _entries(data: bytes, at: int, width: int) -> np.ndarray:
    """(E, width) the entries of a table, whose number stands before them."""
    count = _number(data, at)
    if at + 4 + 4 * width * count > len(data):  # FFmpeg would read them from what follows
        raise _Broken
    return np.frombuffer(data, ">u4", count * width, at + 4).reshape(-1, width).astype(np.float64)


def _items(data: bytes, at: int, name: bytes) -> int:
    """Number of still pictures in a list of them, in either width of its number."""
    version = _number(data, at, 1)
    at += 6 if name == b"iloc" else 4
    return _number(data, at, 4 if version > (1 if name == b"iloc" else 0) else 2)


def _samples(data: bytes, at: int, name: bytes) -> int:
    """Number of samples in a piece of a film."""
    if name != b"saiz":
        return _number(data, at + 4)
    return _number(data, at + (13 if _number(data, at) & 1 else 5))
