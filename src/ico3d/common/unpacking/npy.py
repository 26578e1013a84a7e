"""Reads the head of an array in numpy's format, which may claim to be four gigabytes long."""

import io
import struct
import tokenize
from typing import IO, Any

import numpy as np

LONGEST = 10_000
"""Bytes of a head, as numpy has it: it looks only after it has read and decoded all of it."""
DAMAGED = (
    *(ValueError, EOFError, LookupError, TypeError, AttributeError, ArithmeticError),
    *(RuntimeError, MemoryError, SyntaxError, tokenize.TokenError, struct.error),
)
"""What numpy raises for damaged files: it reads an array's head as Python."""
_LENGTHS = {(1, 0): ("<H", np.lib.format.read_array_header_1_0)} | {
    (2, 0): ("<I", np.lib.format.read_array_header_2_0)
}
"""By version, how the length of a head is written, and what reads it with the head."""


def array_head(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, "np.dtype[Any]"]:
    """Reads the head of an array, and leaves the stream where its numbers begin.

    Args:
        stream: From the first byte of the array's file on.

    Returns:
        Shape, whether the first index is the fastest, and type.

    Raises:
        ValueError: If it is longer than `LONGEST`, or none.
        Exception: Any of `DAMAGED` for a damaged one.
    """
    version = np.lib.format.read_magic(stream)
    if version not in _LENGTHS:
        raise ValueError(f"version {version[0]}.{version[1]} of the format is not known")
    written, read = _LENGTHS[version]
    stated = stream.read(struct.calcsize(written))
    (length,) = struct.unpack(written, stated)
    if length > LONGEST:
        raise ValueError("its head is too long")
    return read(io.BytesIO(stated + stream.read(length)))
