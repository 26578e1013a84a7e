"""Marks on the fields of messages: what their values must be like."""

from dataclasses import dataclass
from typing import Annotated

MAX_EXACT = 2**53  # largest whole number JavaScript holds
LONGEST_NAME = 200


@dataclass(frozen=True)
class Range:
    """Bounds of a number, both included."""

    low: float
    high: float


@dataclass(frozen=True)
class Length:
    """Bounds of a text's characters or a list's items, both included."""

    low: int
    high: int


@dataclass(frozen=True)
class Tensor:
    """An array in the payload of a binary message; its header field holds the shape.

    Attributes:
        dtype: numpy name, little-endian: `<i2` or `<f2`.
        dims: Number of dimensions.
        max_size: Most elements.
    """

    dtype: str
    dims: int
    max_size: int


Count = Annotated[int, Range(0, MAX_EXACT)]
Seconds = Annotated[float, Range(0, 1e7)]
Words = Annotated[str, Length(0, 4000)]
Name = Annotated[str, Length(1, LONGEST_NAME)]
Milliseconds = Annotated[float, Range(-1e7, 1e7)]
