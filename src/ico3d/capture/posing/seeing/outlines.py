"""How far pixels lie within or without the person, in all pictures of a capture."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image
from scipy.ndimage import binary_dilation, distance_transform_edt

from ico3d.common.camera import Camera

LARGEST = 320
"""Pixels of an outline's longer side; larger masks are made smaller."""
STEPS = 8
"""Steps of a stored distance in a pixel: int8 reaches 16 pixels."""


@dataclass(eq=False)
class Outlines:
    """Signed distances to the person's border, positive within.

    Attributes:
        cameras: C cameras of the maps' sizes.
        maps: C arrays (F, H, W) int8, in `STEPS` parts of a pixel.
        known: (F, C) bool: whether there is a mask.
    """

    cameras: list[Camera]
    maps: list[np.ndarray]
    known: np.ndarray

    @staticmethod
    def empty(frames: int, cameras: list[Camera]) -> "Outlines":
        """No masks yet."""
        small = []
        for camera in cameras:
            scale = min(1.0, LARGEST / max(camera.height, camera.width))
            size = (max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))
            small.append(camera.resized(*size))
        # Pages that nobody writes to take no memory: a camera without masks costs nothing.
        maps = [np.zeros((frames, camera.height, camera.width), np.int8) for camera in small]
        return Outlines(small, maps, np.zeros((frames, len(cameras)), bool))

    def add(self, frame: int, place: int, mask: np.ndarray) -> None:
        """Takes down a mask (H, W) in [0, 1] of the picture's size; an empty one counts as none."""
        camera = self.cameras[place]
        picture = Image.fromarray(np.asarray(mask, np.float32))
        small = np.asarray(picture.resize((camera.width, camera.height), Image.Resampling.BOX))
        inside = small > 0.5
        if not inside.any():
            return
        self.maps[place][frame] = np.clip(np.round(_signed(small, inside) * STEPS), -127, 127)
        self.known[frame, place] = True

    def at(self, place: int, frame: int, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances in pixels of the map, bilinear, positive within the person.

        Args:
            place: Which camera.
            frame: Which frame.
            pixels: (N, 2) of the map's camera; beyond its border nothing is known: NaN.

        Returns:
            Distances (N,) and how they grow with pixels, (N, 2).
        """
        stored = self.maps[place][frame]  # (H, W)
        height, width = stored.shape
        spots = np.clip(np.nan_to_num(pixels - 0.5), -2, max(height, width) + 2)
        corner = np.floor(spots).astype(int)
        x, y = (spots - corner).T
        column, row = corner.T
        beyond = (column < 0) | (row < 0) | (column > width - 2) | (row > height - 2)
        column, row = np.clip(column, 0, width - 2), np.clip(row, 0, height - 2)
        a, b, c, d = (
            stored[row + down, column + right].astype(float) / STEPS
            for down in (0, 1)
            for right in (0, 1)
        )
        value = (a * (1 - x) + b * x) * (1 - y) + (c * (1 - x) + d * x) * y
        slope = np.stack([(b - a) * (1 - y) + (d - c) * y, (c - a) * (1 - x) + (d - b) * x], 1)
        return np.where(beyond, np.nan, value), slope


def _signed(coverage: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """(H, W) pixels to the border, positive within.

    The border's own pixels know it by their coverage, all others by the nearest of these.
    """
    rim = np.zeros_like(inside)
    down, right = inside[1:] != inside[:-1], inside[:, 1:] != inside[:, :-1]
    rim[1:] |= down
    rim[:-1] |= down
    rim[:, 1:] |= right
    rim[:, :-1] |= right
    # A full pixel beside a partly covered one leaves it to that to say where the border is.
    partly = (coverage > 0.02) & (coverage < 0.98)
    rim &= partly | ~np.asarray(binary_dilation(partly), bool)
    if not rim.any():
        return np.full(inside.shape, 1.0 * max(inside.shape))  # the person fills the picture
    found: Any = distance_transform_edt(~rim, return_indices=True)
    away, (row, column) = found
    near = coverage[row, column] - 0.5  # of the nearest pixel of the border
    return np.where(inside, away, -away) + near
