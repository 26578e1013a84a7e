"""Reads arrays of numbers from files that may be anybody's."""

from pathlib import Path
from tokenize import TokenError

import numpy as np

from ico3d.common.files import check_regular
from ico3d.errors import CaptureError

LARGEST = 1 << 28
"""Bytes of an array: eleven million points."""
UNREADABLE = (
    OSError,
    ValueError,
    TypeError,
    SyntaxError,
    TokenError,
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
        # Mapped, an array cannot claim more memory than the file has.
        mapped = np.load(file, mmap_mode="r", allow_pickle=False)
    except UNREADABLE as error:
        raise CaptureError(
            f"{file} is damaged and cannot be read: it is no array of numbers."
        ) from error
    if not isinstance(mapped, np.ndarray) or mapped.dtype.kind not in "fiu":
        raise CaptureError(f"{file} is damaged and cannot be read: it holds no array of numbers.")
    if mapped.nbytes > LARGEST:  # a file of zeros takes no room on a disk
        raise CaptureError(f"{file} holds more than {LARGEST >> 20} MiB of numbers: too many.")
    return np.array(mapped)
