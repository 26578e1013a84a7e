"""The mark in a film's corner that says that a machine made the pictures."""

from collections.abc import Iterable, Iterator

import numpy as np
from PIL import Image, ImageDraw, ImageFont

TEXT = "AI"
HEIGHT = 1 / 18
"""Height of the letters, of the picture's shorter side."""
LEAST = 8
"""Height of the letters in pixels, at least."""


def marked(pictures: Iterable[np.ndarray], size: tuple[int, int]) -> Iterator[np.ndarray]:
    """Burns the mark into the upper left corner of pictures.

    Args:
        pictures: (H, W, 3) uint8 RGB.
        size: Width and height of all of them, pixels.

    Yields:
        (H, W, 3) uint8 RGB pictures.
    """
    badge = _badge(max(LEAST, round(min(size) * HEIGHT)))
    rows, columns = min(badge.shape[0], size[1]), min(badge.shape[1], size[0])
    badge = badge[:rows, :columns]  # of a picture smaller than the mark
    cover = badge[..., 3:] / 255.0  # (h, w, 1)
    for picture in pictures:
        shown = picture.copy()
        corner = shown[:rows, :columns] * (1 - cover) + badge[..., :3] * cover  # (h, w, 3)
        shown[:rows, :columns] = corner + 0.5
        yield shown


def _badge(letters: int) -> np.ndarray:
    """The mark and the margin around it: (h, w, 4) uint8 RGB and opacity."""
    font = ImageFont.load_default(letters)
    left, top, right, bottom = font.getbbox(TEXT)
    edge = letters / 2
    width, height = right - left + 2 * edge, bottom - top + 2 * edge
    picture = Image.new("RGBA", (round(width + edge), round(height + edge)))
    draw = ImageDraw.Draw(picture)
    box = (edge, edge, edge + width, edge + height)
    draw.rounded_rectangle(box, radius=edge / 2, fill=(16, 17, 19, 200))
    draw.text((2 * edge - left, 2 * edge - top), TEXT, font=font, fill=(255, 255, 255, 255))
    return np.asarray(picture)
