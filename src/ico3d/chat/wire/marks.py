"""Marks on the fields of messages, which limit their values."""

from dataclasses import dataclass
from typing import Annotated

from ico3d.common.typed import Length, Range

MAX_EXACT = 2**53  # largest whole number JavaScript holds
LONGEST_NAME = 200
LONGEST_WORDS = 4000


@dataclass(frozen=True)
class Tensor:
    """An array in the payload of a binary message; the header has its shape.

    Attributes:
        dtype: numpy's name of the type, little-endian: `<i2` or `<f2`.
        dims: Number of dimensions.
        max_size: Largest number of elements.
    """

    dtype: str
    dims: int
    max_size: int


Count = Annotated[int, Range(0, MAX_EXACT)]
Seconds = Annotated[float, Range(0, 1e7)]
Words = Annotated[str, Length(0, LONGEST_WORDS)]
Name = Annotated[str, Length(1, LONGEST_NAME)]
Milliseconds = Annotated[float, Range(-1e7, 1e7)]
