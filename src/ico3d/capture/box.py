"""Rectangles of pixels."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Box:
    """A rectangle of pixels in a picture.

    Attributes:
        left: First column.
        top: First row.
        width: Number of columns.
        height: Number of rows.
    """

    left: int
    top: int
    width: int
    height: int

    @staticmethod
    def around(inside: np.ndarray) -> "Box | None":
        """The smallest box that holds all nonzero pixels of `inside` (H, W); None if all are 0."""
        rows = np.flatnonzero(inside.any(1))
        if not len(rows):
            return None
        columns = np.flatnonzero(inside[rows[0] : rows[-1] + 1].any(0))
        left, top = int(columns[0]), int(rows[0])
        return Box(left, top, int(columns[-1]) + 1 - left, int(rows[-1]) + 1 - top)

    @property
    def place(self) -> tuple[int, int, int, int]:
        """Left, top, width and height in pixels."""
        return self.left, self.top, self.width, self.height

    @property
    def cut(self) -> tuple[slice, slice]:
        """The box as slices of rows and of columns."""
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)

    def joined(self, other: "Box") -> "Box":
        """The smallest box that holds this one and another."""
        left, top = min(self.left, other.left), min(self.top, other.top)
        right = max(self.left + self.width, other.left + other.width)
        bottom = max(self.top + self.height, other.top + other.height)
        return Box(left, top, right - left, bottom - top)

    def grown(self, margin: int, width: int, height: int) -> "Box":
        """This box with a margin on all sides, as far as a picture of this size goes."""
        left, top = max(self.left - margin, 0), max(self.top - margin, 0)
        right = min(self.left + self.width + margin, width)
        bottom = min(self.top + self.height + margin, height)
        return Box(left, top, right - left, bottom - top)

    def within(self, other: "Box") -> "Box":
        """This box in pixels of `other`, which holds it."""
        return Box(self.left - other.left, self.top - other.top, self.width, self.height)


def cut_out(picture: np.ndarray, box: Box | None) -> np.ndarray:
    """The part of a picture (H, W, ...) in a box; the whole picture for None."""
    return picture if box is None else picture[box.cut]
