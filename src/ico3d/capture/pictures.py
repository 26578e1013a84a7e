"""Views of a capture for training, and a cache for their pictures."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera


@dataclass(frozen=True)
class View:
    """A view: one frame as one camera shows it.

    Attributes:
        camera_index: Index of the camera in the capture.
        frame: Number of the frame.
        camera: The camera, in the space of the trained model.
    """

    camera_index: int
    frame: int
    camera: Camera


def train_cameras(capture: Capture) -> tuple[int, ...]:
    """Indices of the cameras that are not reserved for tests."""
    return tuple(i for i in range(len(capture.cameras)) if i not in capture.split.test_cameras)


Layers = tuple[np.ndarray | None, ...]
"""A picture and arrays that belong to it, such as masks: (H, W, ...) each, or None."""


class LayerCache:
    """Layers, kept in memory as bytes up to a limit, otherwise read at each use."""

    def __init__(self, read: Callable[[int, int], Layers | None], budget_gib: float):
        """Sets the reader and the limit of memory.

        Args:
            read: Returns layers in [0, 1] for a camera and a frame, or None if there is no picture.
            budget_gib: Limit of memory, GiB.
        """
        self._read = read
        self._left = int(budget_gib * 2**30)
        self._kept: dict[tuple[int, int], Layers] = {}

    def layers(self, camera: int, frame: int) -> Layers | None:
        """The layers as uint8, or None if there is no picture."""
        if (camera, frame) in self._kept:
            return self._kept[camera, frame]
        values = self._read(camera, frame)
        if values is None:
            return None
        layers = tuple(None if value is None else _as_bytes(value) for value in values)
        size = sum(layer.nbytes for layer in layers if layer is not None)
        if size <= self._left:
            self._left -= size
            self._kept[camera, frame] = layers
        return layers


def _as_bytes(picture: np.ndarray) -> np.ndarray:
    return (picture * 255 + 0.5).astype(np.uint8)
