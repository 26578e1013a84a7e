"""Counts what a picture has beside its pixels: Pillow reads all of it into the memory."""

from typing import BinaryIO

from ico3d.capture.vetting.scans import BEGIN, END, MOST_MARKS, SCAN, next_mark

BESIDE = 16 << 20
"""Bytes beside the pixels: profiles, previews and texts of real pictures have at most some MiB."""
LARGEST_OTHER = 64 << 20
"""Bytes of a picture that is neither PNG nor JPEG, pixels and all."""
MOST_CHUNKS = 200_000
"""Pieces of a picture; programs cut 8 KiB each, of the largest picture some ten thousand."""
MOST_EXIF = 64
"""Pieces of a JPEG picture's remarks; to each Pillow copies all before it. Cameras write one."""
LAST = b"IEND"
"""Kind of a PNG picture's last piece; what lies behind it is no part of the picture."""
SIGNATURE, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
EXIF = b"Exif\0\0"


def is_bulky(file: BinaryIO) -> bool:
    """Whether a file that begins as neither PNG nor JPEG does is larger than `LARGEST_OTHER`.

    Args:
        file: The file. It stands somewhere else afterwards.
    """
    file.seek(0)
    if file.read(len(SIGNATURE)).startswith((SIGNATURE, JPEG)):
        return False
    return file.seek(0, 2) > LARGEST_OTHER


def has_large_chunks(file: BinaryIO) -> bool:
    """Whether a picture has more than `BESIDE` bytes beside its pixels, or too many pieces of them.

    Args:
        file: The picture: PNG or JPEG, as others are bounded as a whole. It stands somewhere else
            afterwards.
    """
    file.seek(0)
    begin = file.read(len(SIGNATURE))
    if begin == SIGNATURE:
        return _large_in_png(file)
    return begin.startswith(JPEG) and _large_in_jpeg(file)


def _large_in_png(file: BinaryIO) -> bool:
    beside = 0
    for _ in range(MOST_CHUNKS):
        head = file.read(8)
        if len(head) < 8 or head[4:] == LAST:
            return False
        length, kind = int.from_bytes(head[:4], "big"), head[4:]
        if kind != b"IDAT":
            beside += length
        if beside > BESIDE:
            return True
        file.seek(length + 4, 1)  # and its sum
    return True


def _large_in_jpeg(file: BinaryIO) -> bool:
    file.seek(len(JPEG))
    beside = remarks = 0
    for _ in range(MOST_MARKS):
        mark = next_mark(file)
        if mark in (None, END, SCAN):
            return False
        if mark == BEGIN:
            continue
        length = int.from_bytes(file.read(2), "big")
        start = file.tell()
        beside += length
        remarks += file.read(len(EXIF)) == EXIF
        if beside > BESIDE or remarks > MOST_EXIF:
            return True
        file.seek(start + max(length - 2, 0))
    return True
