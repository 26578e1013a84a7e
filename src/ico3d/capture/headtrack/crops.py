"""Parts of pictures in which MediaPipe looks for a face.

MediaPipe finds faces that fill at least a fifth of a picture. In pictures of whole bodies faces are
30 to 60 pixels high, so MediaPipe gets parts of the picture, scaled to one size.
"""

from dataclasses import dataclass, replace

import numpy as np
from PIL import Image

from ico3d.capture.face.mediapipe_face import Face
from ico3d.common.camera import Camera

READ_AT = 384
"""Side in pixels of the pictures that MediaPipe gets."""
HEAD = 0.48
"""Size in metres of the part around a head: twice the head's height."""
LARGEST = 2
"""Largest part around a head, as a factor of the picture's longer side."""
STEPS = (1, 2, 4)
"""Sizes of searched parts: the whole person, a half and a quarter of the height."""
FILLED = 0.05
"""Least share of a part that the person must fill for the part to be searched."""


@dataclass(frozen=True)
class Part:
    """A square part of a picture; outside of the picture it is black.

    Attributes:
        left: First column in pixels; may be negative.
        top: First row in pixels; may be negative.
        side: Side in pixels.
    """

    left: int
    top: int
    side: int

    def cut(self, image: np.ndarray) -> np.ndarray:
        """The part of a picture (H, W, 3), float in [0, 1], as uint8 RGB (READ_AT, READ_AT, 3)."""
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
        """Converts pixels (N, 2) of the part that `cut` returns to pixels of the whole picture."""
        return pixels * (self.side / READ_AT) + (self.left, self.top)

    def whole_face(self, face: Face) -> Face:
        """Converts a face in the part that `cut` returns to pixels of the whole picture."""
        depths = None if face.depths is None else face.depths * (self.side / READ_AT)
        return replace(face, landmarks=self.whole(face.landmarks), depths=depths)


def around(camera: Camera, center: np.ndarray, size: float = HEAD) -> Part | None:
    """The part of a camera's picture that shows a ball around a point.

    Args:
        camera: The camera that looks at the ball.
        center: (3,) the point in the world, metres.
        size: Diameter of the ball, metres.

    Returns:
        The part, or None if the ball is outside of the picture or behind the camera, or so near
        to it that the picture shows next to nothing of the ball.
    """
    pixel, depth = camera.project(center)
    if depth <= 0:
        return None
    side = max(8, round(min(size * float(camera.intrinsics[0, 0] / depth), 1e9)))
    if side > LARGEST * max(camera.width, camera.height):
        return None
    part = Part(round(float(pixel[0]) - side / 2), round(float(pixel[1]) - side / 2), side)
    outside = part.left >= camera.width or part.top >= camera.height
    return None if outside or min(part.left, part.top) <= -side else part


def search(height: int, width: int, mask: np.ndarray | None) -> list[Part]:
    """Parts to search for a face, likely ones first; one of them shows the face large enough.

    Args:
        height: Rows of the picture.
        width: Columns of the picture.
        mask: (H, W) the person, 1 inside; None searches the whole picture.
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
