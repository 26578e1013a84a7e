"""Reads arrays of numbers from files that may be anybody's."""

import math
from pathlib import Path

import numpy as np

from ico3d.common.files import check_regular
from ico3d.common.unpacking.npy import DAMAGED, array_head
from ico3d.common.unpacking.npz import WIDTH
from ico3d.errors import CaptureError

LARGEST = 1 << 26
"""Bytes of an array as numbers of 64 bits: almost three million points."""


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
        if math.prod(shape) * max(kind.itemsize, WIDTH) > LARGEST:  # zeros take no room on a disk
            raise CaptureError(f"{file} holds more than {LARGEST >> 20} MiB of numbers: too many.")
        # Mapped, an array cannot claim more memory than the file has.
        mapped = np.memmap(file, kind, "r", begin, shape, "F" if fortran else "C")
    except (OSError, *DAMAGED) as error:
        raise CaptureError(
            f"{file} is damaged and cannot be read: it is no array of numbers."
        ) from error
    return np.array(mapped)
