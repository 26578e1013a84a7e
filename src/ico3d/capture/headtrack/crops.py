"""Parts of pictures in which a face is looked for.

MediaPipe finds faces that fill a fifth of a picture and more. In pictures of whole bodies they are
30 to 60 pixels high, so it is shown parts, scaled to one size.
"""

from dataclasses import dataclass

import numpy as np
from PIL import Image

from ico3d.common.camera import Camera

READ_AT = 384
"""Pixels of the side of what MediaPipe is shown."""
HEAD = 0.48
"""Metres that a part around a head shows: twice its height."""
STEPS = (1, 2, 4)
"""A search looks at the whole person, at halves and at quarters of the height."""
FILLED = 0.05
"""Share of a part that the person must fill for a look at it."""


@dataclass(frozen=True)
class Part:
    """A square part of a picture; it may reach beyond the picture, which is black there.

    Attributes:
        left: First column.
        top: First row.
        side: Pixels.
    """

    left: int
    top: int
    side: int

    def cut(self, image: np.ndarray) -> np.ndarray:
        """uint8 RGB (READ_AT, READ_AT, 3) of a picture (H, W, 3), float in [0, 1]."""
        rows = slice(max(self.top, 0), max(self.top + self.side, 0))
        columns = slice(max(self.left, 0), max(self.left + self.side, 0))
        inside = image[rows, columns]
        whole = np.zeros((self.side, self.side, 3), np.uint8)
        down, right = max(-self.top, 0), max(-self.left, 0)
        height, width = inside.shape[:2]
        whole[down : down + height, right : right + width] = inside * 255 + 0.5
        scaled = Image.fromarray(whole).resize((READ_AT, READ_AT), Image.Resampling.BICUBIC)
        return np.asarray(scaled)

    def whole(self, pixels: np.ndarray) -> np.ndarray:
        """Pixels (N, 2) of what `cut` gives as pixels of the whole picture."""
        return pixels * (self.side / READ_AT) + (self.left, self.top)


def around(camera: Camera, center: np.ndarray, size: float = HEAD) -> Part | None:
    """The part that shows a ball around a point of the world.

    Args:
        camera: Who looks.
        center: (3,) metres.
        size: Metres across.

    Returns:
        The part, or None where it lies outside the picture or behind the camera.
    """
    pixel, depth = camera.project(center)
    if depth <= 0:
        return None
    side = max(8, round(size * float(camera.intrinsics[0, 0] / depth)))
    part = Part(round(float(pixel[0]) - side / 2), round(float(pixel[1]) - side / 2), side)
    outside = part.left >= camera.width or part.top >= camera.height
    return None if outside or min(part.left, part.top) <= -side else part


def search(height: int, width: int, mask: np.ndarray | None) -> list[Part]:
    """Parts of a picture one of which shows a person's face large enough, likely ones first.

    Args:
        height: Rows of the picture.
        width: Columns.
        mask: (H, W) the person, 1 inside; the whole picture is searched where it is None.
    """
    person = np.ones((height, width), bool) if mask is None else mask > 0.5
    rows, columns = np.flatnonzero(person.any(1)), np.flatnonzero(person.any(0))
    if not len(rows):
        return []
    top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
    parts = []
    for step in STEPS:
        side = -(-max(bottom - top, right - left) // step)
        across = _starts(left, right, side)
        across.sort(key=lambda start: abs(start + side / 2 - (left + right) / 2))
        parts += [Part(x, y, int(side)) for y in _starts(top, bottom, side) for x in across]
    return [part for part in parts if _share(person, part) >= FILLED]


def _starts(first: int, stop: int, side: int) -> list[int]:
    """Where windows that overlap by half begin, to cover first … stop."""
    length = stop - first
    if length <= side:
        return [int(first + (length - side) // 2)]
    count = -(-2 * (length - side) // side) + 1
    return np.linspace(first, stop - side, count).round().astype(int).tolist()


def _share(person: np.ndarray, part: Part) -> float:
    """Which share of a part the person fills."""
    rows = slice(max(part.top, 0), part.top + part.side)
    columns = slice(max(part.left, 0), part.left + part.side)
    return float(person[rows, columns].sum()) / part.side**2
