"""Views of a capture for training, and a cache for their pictures."""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
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


AHEAD = 8
"""Steps of training for which pictures are read in advance."""
READERS = min(8, os.cpu_count() or 1)
"""Threads that read pictures while training computes."""


def read_in_turn(
    read: Callable[[int], np.ndarray | None], frames: Iterable[int]
) -> Iterator[tuple[int, np.ndarray | None]]:
    """Frames and what was read of them, in order; several threads read, a few frames ahead."""
    with ThreadPoolExecutor(READERS, "pictures") as readers:
        coming: deque[tuple[int, Future[np.ndarray | None]]] = deque()
        for frame in frames:
            coming.append((frame, readers.submit(read, frame)))
            if len(coming) > READERS:
                number, done = coming.popleft()
                yield number, done.result()
        for number, done in coming:
            yield number, done.result()


class LayerCache:
    """Layers, kept in memory as bytes up to a limit, otherwise read at each use.

    What will be asked for soon is read in the background, for decoding a large picture takes longer
    than a step of training on a GPU.
    """

    def __init__(self, read: Callable[[int, int], Layers | None], budget_gib: float):
        """Sets the reader and the limit of memory.

        Args:
            read: Returns layers in [0, 1] for a camera and a frame, or None if there is no picture;
                several threads call it.
            budget_gib: Limit of memory, GiB; pictures that were read in advance come on top of it.
        """
        self._read = read
        self._left = int(budget_gib * 2**30)
        self._kept: dict[tuple[int, int], Layers] = {}
        self._coming: dict[tuple[int, int], Future[Layers | None]] = {}
        self._readers = ThreadPoolExecutor(READERS, "pictures")  # starts no thread before its first

    def expect(self, views: Iterable[View]) -> None:
        """Begins to read the views that are neither kept nor on their way."""
        for key in ((view.camera_index, view.frame) for view in views):
            if key not in self._kept and key not in self._coming:
                self._coming[key] = self._readers.submit(self._as_read, *key)

    def layers(self, camera: int, frame: int) -> Layers | None:
        """The layers as uint8, or None if there is no picture; waits for one that is on its way."""
        key = (camera, frame)
        if key in self._kept:
            return self._kept[key]
        coming = self._coming.pop(key, None)
        layers = self._as_read(camera, frame) if coming is None else coming.result()
        if layers is None:
            return None
        size = sum(layer.nbytes for layer in layers if layer is not None)
        if size <= self._left:
            self._left -= size
            self._kept[key] = layers
        return layers

    def _as_read(self, camera: int, frame: int) -> Layers | None:
        """The layers as uint8, read now."""
        values = self._read(camera, frame)
        return values and tuple(None if value is None else _as_bytes(value) for value in values)


def _as_bytes(picture: np.ndarray) -> np.ndarray:
    return (picture * 255 + 0.5).astype(np.uint8)
