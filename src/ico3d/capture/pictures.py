"""Which pictures a training looks at, and how they stay in memory."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera


@dataclass(frozen=True)
class View:
    """One picture of one frame.

    Attributes:
        camera_index: Number of the camera that took the picture.
        frame: Number of the frame.
        camera: That camera, in the space of what is trained.
    """

    camera_index: int
    frame: int
    camera: Camera


def train_cameras(capture: Capture) -> tuple[int, ...]:
    """Numbers of the cameras that may be learnt from."""
    return tuple(i for i in range(len(capture.cameras)) if i not in capture.split.test_cameras)


Layers = tuple[np.ndarray | None, ...]
"""A picture and what belongs to it, such as masks: (H, W, ...) each."""


class LayerCache:
    """Layers kept as bytes within a budget, else read again at each use."""

    def __init__(self, read: Callable[[int, int], Layers | None], budget_gib: float):
        """Keeps up to `budget_gib` GiB of what `read` gives for a camera and a frame.

        Args:
            read: Gives values in [0, 1], or None where there is no picture.
            budget_gib: Memory.
        """
        self._read = read
        self._left = int(budget_gib * 2**30)
        self._kept: dict[tuple[int, int], Layers] = {}

    def layers(self, camera: int, frame: int) -> Layers | None:
        """The layers as uint8, or None where there is no picture."""
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
