"""A cache of pictures that are read ahead of the steps of training."""

import logging
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import numpy as np

from ico3d.capture.pictures import View
from ico3d.capture.reading.memory import Budget, Gib
from ico3d.capture.reading.spill import Layers, Spill, Stored, size_of
from ico3d.errors import CaptureError

log = logging.getLogger(__name__)

AHEAD = 8
"""Steps of training for which pictures are read in advance where memory keeps no more."""
HORIZON = 2_000
"""Most steps for which pictures are read in advance."""
QUEUED = 32
"""Most pictures that wait for a reader: a training that ends, or is interrupted, reads them all."""
READERS = min(8, os.cpu_count() or 1)
"""Threads that read pictures while training computes; decoding lets go of Python's lock."""
MOST_LOST = 0.05
"""Share of the pictures that training goes on without; one may always be lost."""

Key = tuple[int, int]
"""Camera and frame."""
Item = TypeVar("Item")
Result = TypeVar("Result")


def read_in_turn(
    read: Callable[[Item], Result], items: Iterable[Item]
) -> Iterator[tuple[Item, Result]]:
    """Items and what was read for them, in order; several threads read, a few items ahead."""
    with ThreadPoolExecutor(READERS, "pictures") as readers:
        coming: deque[tuple[Item, Future[Result]]] = deque()
        for item in items:
            coming.append((item, readers.submit(read, item)))
            if len(coming) > READERS:
                first, done = coming.popleft()
                yield first, done.result()
        for first, done in coming:
            yield first, done.result()


class LayerCache:
    """Layers that are kept in memory, then on a disk, as far as both go, and read ahead of use.

    Decoding a large picture takes longer than a step of training on a GPU. So pictures of later
    steps are read in the background, and the further ahead the more memory is left.
    """

    def __init__(self, read: Callable[[int, int], Layers | None], gib: Gib, folder: str = ""):
        """Sets the reader and the limits.

        Args:
            read: Returns layers for a camera and a frame, or None if there is no picture; several
                threads call it.
            gib: Limit of memory, GiB; the pictures of the next steps come on top of it.
            folder: Where to keep what does not fit in memory; "" to read it again at each use.

        Raises:
            SettingsError: If the folder cannot be written to.
        """
        self._read = read
        self.budget = Budget(gib)
        self._spill = Spill(Path(folder)) if folder else None
        self._kept: dict[Key, Layers] = {}
        self._stored: dict[Key, Stored] = {}
        self._coming: dict[Key, Future[Layers | None]] = {}
        self._queue: deque[Future[Layers | None]] = deque()  # what is not read yet, in order
        self._current: tuple[Key, Layers] | None = None
        self._lost: set[Key] = set()
        self._expected = 0  # steps before this one have been asked for
        self._typical = 0  # bytes of a picture's layers
        self._readers = ThreadPoolExecutor(READERS, "pictures")  # starts no thread before its first

    def expect(self, steps: range, view: Callable[[int], View]) -> None:
        """Begins to read what coming steps need, as far ahead as memory goes.

        Args:
            steps: The steps of the training from the next one to the last.
            view: The view of a step.
        """
        first = steps.start
        if not first <= self._expected <= first + HORIZON:
            self._expected = first
        while self._queue and self._queue[0].done():  # counting all that come takes milliseconds
            self._queue.popleft()
        room = None
        for step in range(self._expected, min(steps.stop, first + HORIZON)):
            key = _key(view(step))
            if not (key in self._kept or key in self._coming or key in self._lost):
                if room is None:  # asking the system takes as long as drawing a small picture
                    room = self.budget.left() // self._typical if self._typical else 0
                full = len(self._coming) >= room or len(self._queue) >= QUEUED
                if step >= first + AHEAD and full:
                    break
                self._coming[key] = self._readers.submit(self._load, *key)
                self._queue.append(self._coming[key])
            self._expected = step + 1

    def readable(self, views: Sequence[View], place: int) -> View:
        """The view at a place, or the next one whose picture can be read.

        A picture that is damaged, or has vanished, is told once in a warning.

        Raises:
            CaptureError: If more than `MOST_LOST` of the pictures cannot be read.
        """
        for offset in range(len(views)):
            view = views[(place + offset) % len(views)]
            key = _key(view)
            if key in self._lost:
                continue
            try:
                layers = self.layers(*key)
                if layers is None:
                    name = view.camera.name or view.camera_index
                    raise CaptureError(
                        f"the picture of frame {view.frame} by camera {name} has vanished."
                    )
            except CaptureError as error:
                self._lose(key, error, len(views))
                continue
            self._current = key, layers
            return view
        raise CaptureError("none of the pictures can be read.")

    def layers(self, camera: int, frame: int) -> Layers | None:
        """The layers, or None if there is no picture; waits for one that is on its way."""
        key = (camera, frame)
        if self._current is not None and self._current[0] == key:
            return self._current[1]
        if key in self._kept:
            return self._kept[key]
        coming = self._coming.pop(key, None)
        layers = self._load(camera, frame) if coming is None else coming.result()
        if layers is None:
            return None
        size = self._typical = size_of(layers)
        if self.budget.take(size):
            self._kept[key] = layers
        return layers

    def needs(self, count: int) -> tuple[int, int]:
        """Bytes of `count` views' layers, judged by those read last, and how many memory keeps."""
        total = self._typical * count
        kept = sum(size_of(layers) for layers in self._kept.values())
        return total, min(total, kept + max(self.budget.left(), 0))

    def _load(self, camera: int, frame: int) -> Layers | None:
        """The layers from the disk, or read now and written there if memory does not keep them."""
        if self._spill is None:
            return self._read_now(camera, frame)
        stored = self._stored.get((camera, frame))
        if stored is not None:
            return self._spill.read(stored)
        layers = self._read_now(camera, frame)
        if layers is not None and size_of(layers) * (1 + len(self._coming)) > self.budget.left():
            stored = self._spill.write(layers)
            if stored is not None:
                self._stored[camera, frame] = stored
        return layers

    def _read_now(self, camera: int, frame: int) -> Layers | None:
        """The layers, decoded now; torch warns of arrays that cannot be written to."""
        layers = self._read(camera, frame)
        if layers is None:
            return None
        return tuple(
            None if layer is None else np.require(layer, requirements="W") for layer in layers
        )

    def _lose(self, key: Key, error: CaptureError, total: int) -> None:
        """Goes on without a picture.

        Raises:
            CaptureError: If there are too many of them.
        """
        self._lost.add(key)
        go_on_without(error, len(self._lost), total)


class ReadAhead:
    """Pictures of views that a `LayerCache` reads ahead of the steps of a training."""

    def __init__(self, cache: LayerCache):
        """Takes the cache, which knows how pictures are read."""
        self._cache = cache

    def expect(self, steps: range, view: Callable[[int], View]) -> None:
        """Begins to read what coming steps need, as `LayerCache.expect`."""
        self._cache.expect(steps, view)

    def readable(self, views: Sequence[View], place: int) -> View:
        """The view at a place, or the next that can be read, as `LayerCache.readable`."""
        return self._cache.readable(views, place)

    def needs(self, count: int) -> tuple[int, int]:
        """Bytes of `count` views' pictures, and how many of them memory keeps."""
        return self._cache.needs(count)


def go_on_without(error: CaptureError, lost: int, total: int) -> None:
    """Warns of a picture or mask that cannot be read.

    Args:
        error: What is wrong with it.
        lost: Number of pictures that cannot be read, with this one.
        total: Number of all pictures.

    Raises:
        CaptureError: If more than `MOST_LOST` of them cannot be read.
    """
    if lost > max(1, MOST_LOST * total):
        raise CaptureError(
            f"{lost} of {total} pictures cannot be read, too many to train without; mend or remove "
            f"them and run the same command again. The last one: {error}"
        ) from error
    log.warning("%s Training goes on without this picture.", error)


def _key(view: View) -> Key:
    return view.camera_index, view.frame
