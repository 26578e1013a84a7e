"""Counts what a PNG picture has beside its pixels: Pillow reads all of it into the memory."""

from typing import BinaryIO

BESIDE = 16 << 20
"""Bytes beside the pixels: profiles, previews and texts of real pictures have at most some MiB."""
MOST_CHUNKS = 200_000
"""Pieces of a picture; programs cut 8 KiB each, of the largest picture some ten thousand."""
END = b"IEND"
"""Kind of the last piece; what lies behind it is no part of the picture."""
SIGNATURE = b"\x89PNG\r\n\x1a\n"


def has_large_chunks(file: BinaryIO) -> bool:
    """Whether a PNG picture has more than `BESIDE` bytes beside its pixels, or `MOST_CHUNKS`.

    Args:
        file: The picture; other kinds have no chunks. It stands somewhere else afterwards.
    """
    file.seek(0)
    if file.read(len(SIGNATURE)) != SIGNATURE:
        return False
    beside = 0
    for _ in range(MOST_CHUNKS):
        head = file.read(8)
        if len(head) < 8 or head[4:] == END:
            return False
        length, kind = int.from_bytes(head[:4], "big"), head[4:]
        if kind != b"IDAT":
            beside += length
        if beside > BESIDE:
            return True
        file.seek(length + 4, 1)  # and its sum
    return True
