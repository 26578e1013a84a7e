"""Reads arrays of numbers from files that may be anybody's."""

from pathlib import Path
from struct import error as StructError
from tokenize import TokenError

import numpy as np

from ico3d.common.files import check_regular
from ico3d.common.unpacking.npy import array_head
from ico3d.errors import CaptureError

LARGEST = 1 << 28
"""Bytes of an array: eleven million points."""
UNREADABLE = (
    OSError,
    ValueError,
    TypeError,
    SyntaxError,
    TokenError,
    StructError,
    EOFError,
    MemoryError,
    OverflowError,
    RecursionError,
)
"""What NumPy raises for files whose header is damaged or claims more than the file has."""


def read_numbers(file: Path) -> np.ndarray:
    """The array in a .npy file.

    Raises:
        CaptureError: If the file holds none, or a larger one than `LARGEST`, or one of anything but
            real numbers.
    """
    try:
        check_regular(file)
        with file.open("rb") as opened:
            shape, fortran, kind = array_head(opened)
            begin = opened.tell()
        if kind.kind not in "fiu":
            raise ValueError("no numbers")
        # Mapped, an array cannot claim more memory than the file has.
        mapped = np.memmap(file, kind, "r", begin, shape, "F" if fortran else "C")
    except UNREADABLE as error:
        raise CaptureError(
            f"{file} is damaged and cannot be read: it is no array of numbers."
        ) from error
    if mapped.nbytes > LARGEST:  # a file of zeros takes no room on a disk
        raise CaptureError(f"{file} holds more than {LARGEST >> 20} MiB of numbers: too many.")
    return np.array(mapped)
