"""Pictures that do not fit in memory, decoded on a disk."""

import logging
import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

import numpy as np

from ico3d.common.files import FULL, SPARE
from ico3d.errors import SettingsError

log = logging.getLogger(__name__)

Layers = tuple[np.ndarray | None, ...]
"""A picture and arrays that belong to it, such as masks: uint8 (H, W, ...) each, or None."""


@dataclass(frozen=True)
class Stored:
    """Where layers lie in a file.

    Attributes:
        offset: Their first byte.
        shapes: Shape of each layer; None for one that is None.
    """

    offset: int
    shapes: tuple[tuple[int, ...] | None, ...]


class Spill:
    """Layers in a file without a name, which vanishes with this process, however that ends."""

    def __init__(self, folder: Path):
        """Makes the file.

        It grows while `SPARE` bytes of the disk stay free: other files are written there as well.

        Args:
            folder: A folder on a disk with room; made where missing.

        Raises:
            SettingsError: If nothing can be written there.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115
        except OSError as error:
            raise SettingsError(
                f"--cache-dir {folder} cannot be written to ({error.strerror}): choose another."
            ) from error
        self._end, self._turn, self._full = 0, Lock(), False

    def write(self, layers: Layers) -> Stored | None:
        """Stores layers; None once the disk is full, which is said once."""
        size = size_of(layers)
        with self._turn:
            if not self._full and self._free() < size + SPARE:
                self._fill()
            if self._full:
                return None
            begin, self._end = self._end, self._end + size
        offset = begin
        try:
            for layer in layers:
                offset += 0 if layer is None else self._write(layer, offset)
        except OSError as error:
            if error.errno not in FULL:
                raise
            self._fill()
            return None
        return Stored(begin, tuple(None if layer is None else layer.shape for layer in layers))

    def _free(self) -> int:
        """Bytes that are left on the disk."""
        return shutil.disk_usage(self._file.fileno()).free  # its folder may be gone

    def _fill(self) -> None:
        self._full = True
        log.warning("The disk of --cache-dir is full: further pictures are decoded at each use.")

    def read(self, stored: Stored) -> Layers:
        """The layers that were stored."""
        layers, offset = [], stored.offset
        for shape in stored.shapes:
            if shape is None:
                layers.append(None)
                continue
            layer = np.empty(shape, np.uint8)
            offset += os.preadv(self._file.fileno(), [layer.data], offset)
            layers.append(layer)
        return tuple(layers)

    def _write(self, layer: np.ndarray, offset: int) -> int:
        """Writes one layer at an offset; its size."""
        rest = np.ascontiguousarray(layer).data.cast("B")
        while rest:
            done = os.pwrite(self._file.fileno(), rest, offset)
            rest, offset = rest[done:], offset + done
        return layer.nbytes


def size_of(layers: Layers) -> int:
    """Bytes of layers."""
    return sum(layer.nbytes for layer in layers if layer is not None)
