"""Signed distances of pixels from the person's outline, in all pictures of a capture."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image
from scipy.ndimage import binary_dilation, distance_transform_edt

from ico3d.common.camera import Camera

LARGEST = 320
"""Longer side in pixels to which larger masks are scaled down."""
STEPS = 8
"""Stored distances are in units of 1/8 pixel, so that int8 reaches 16 pixels."""


@dataclass(eq=False)
class Outlines:
    """Maps of signed distances from the person's outline, positive inside.

    Attributes:
        cameras: The C cameras, scaled to the sizes of their maps.
        maps: For each camera, (F, H, W) int8 distances in units of 1 / `STEPS` pixel of the map.
        known: (F, C) bool: whether a frame of a camera has a mask.
    """

    cameras: list[Camera]
    maps: list[np.ndarray]
    known: np.ndarray

    @staticmethod
    def empty(frames: int, cameras: list[Camera]) -> "Outlines":
        """Outlines of `frames` frames without any masks."""
        small = []
        for camera in cameras:
            scale = min(1.0, LARGEST / max(camera.height, camera.width))
            size = (max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))
            small.append(camera.resized(*size))
        # Memory pages that are never written take no memory: cameras without masks cost nothing.
        maps = [np.zeros((frames, camera.height, camera.width), np.int8) for camera in small]
        return Outlines(small, maps, np.zeros((frames, len(cameras)), bool))

    def add(self, frame: int, place: int, mask: np.ndarray) -> None:
        """Adds a mask; one that shows nobody is left out.

        Args:
            frame: Index of the frame.
            place: Index of the camera.
            mask: (H, W) in [0, 1], of the size of the recorded picture.
        """
        camera = self.cameras[place]
        picture = Image.fromarray(np.asarray(mask, np.float32))
        small = np.asarray(picture.resize((camera.width, camera.height), Image.Resampling.BOX))
        inside = small > 0.5
        if not inside.any():
            return
        self.maps[place][frame] = np.clip(np.round(_signed(small, inside) * STEPS), -127, 127)
        self.known[frame, place] = True

    def at(self, place: int, frame: int, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distances at pixels, interpolated bilinearly.

        Args:
            place: Index of the camera.
            frame: Index of the frame.
            pixels: (N, 2) pixels of the map's camera.

        Returns:
            (N,) distances in pixels of the map, positive inside the person, NaN outside of the
            picture; and (N, 2) their derivatives by the pixels.
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
    """(H, W) signed distances from the border in pixels, positive inside.

    Pixels of the border take their distance from their coverage; all others take the distance to
    the nearest of these, plus its own.

    Args:
        coverage: (H, W) share of each pixel that the person covers.
        inside: (H, W) bool: pixels that count as the person.
    """
    rim = np.zeros_like(inside)
    down, right = inside[1:] != inside[:-1], inside[:, 1:] != inside[:, :-1]
    rim[1:] |= down
    rim[:-1] |= down
    rim[:, 1:] |= right
    rim[:, :-1] |= right
    # Beside a partly covered pixel, a full or empty one is no border: the former tells it better.
    partly = (coverage > 0.02) & (coverage < 0.98)
    rim &= partly | ~np.asarray(binary_dilation(partly), bool)
    if not rim.any():
        return np.full(inside.shape, 1.0 * max(inside.shape))  # the person fills the picture
    found: Any = distance_transform_edt(~rim, return_indices=True)
    away, (row, column) = found
    near = coverage[row, column] - 0.5  # signed distance of the nearest pixel of the border
    return np.where(inside, away, -away) + near
