"""Reads SMC files, a kind of HDF5 file, one piece at a time."""

import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ico3d.capture.extras import hdf5
from ico3d.capture.smc.unpacking import first_bytes, is_bounded
from ico3d.errors import CaptureError

PURPOSE = "reading SMC files"
LARGEST = 256 * 2**20
"""Largest size of one piece in bytes, in the file's own numbers and in those that are returned.

A damaged header can claim any number, and what was never written takes no bytes of the file.
"""
LARGEST_PICTURE = 64 * 2**20
"""The same of an encoded picture; 4096 × 3000 pixels take 37 MB where nothing packs them."""
MOST_ROWS = 100_000
"""Largest number of frames, and of rows of a table where any number is allowed."""
LARGEST_ATTRIBUTE = 4096
"""Largest size of an attribute in bytes; they are numbers and words."""
MOST_LINKS, LONGEST_LINK = 32, 4096
"""Links by name on one path, and letters of what one names; links in a circle have no end."""
_NUMBER = re.compile("[0-9]{1,9}")
DAMAGED = (OSError, KeyError, ValueError, TypeError, RuntimeError, OverflowError, MemoryError)
"""What h5py raises for damaged files."""


class SmcFile:
    """An SMC file, opened when it is first read and anew in each process.

    HDF5 handles belong to the process that opened them; a copy that was pickled, or inherited by a
    forked process, opens the file again.
    """

    def __init__(self, path: Path):
        """Takes the path; the file is opened when it is first read.

        Args:
            path: Path of the file.
        """
        self.path = path
        self._opened: tuple[int, Any] | None = None
        self._names: dict[str, frozenset[str]] = {}

    def __getstate__(self) -> dict:
        return {"path": self.path, "_opened": None, "_names": self._names}

    def keys(self, inside: str) -> list[str]:
        """Names in a group; empty if there is no such group."""
        with self._guard(inside):
            group = self._find(inside)
            # Names that are no UTF-8 come as bytes; ours are all digits.
            return [k for k in group if isinstance(k, str)] if _is(group, "Group") else []

    def numbered(self, inside: str) -> list[int]:
        """The numbers that are names in a group, in order."""
        return sorted(int(name) for name in self.keys(inside) if _NUMBER.fullmatch(name))

    def holds(self, inside: str) -> bool:
        """Whether there is a group or dataset at this path."""
        with self._guard(inside):
            return self._find(inside) is not None

    def lists(self, inside: str) -> bool:
        """Whether the group above a path has its last name; each group is read only once.

        A recording has tens of thousands of pictures, for each of which `holds` walks the file.
        """
        group, _, name = inside.rpartition("/")
        if group not in self._names:
            self._names[group] = frozenset(self.keys(group))
        return name in self._names[group]

    def attribute(self, inside: str, name: str) -> Any:
        """An attribute of a group, or None if missing.

        Raises:
            CaptureError: If the file or the attribute is damaged.
        """
        with self._guard(inside):
            node = self._find(inside)
            if node is None or name not in node.attrs:
                return None
            about = node.attrs.get_id(name)
            count = np.prod(about.shape, dtype=float)
            # What changes in length lies elsewhere, and many values may lie in one place.
            elsewhere = about.dtype.hasobject and count > 1
            if elsewhere or count * about.dtype.itemsize > LARGEST_ATTRIBUTE:
                raise self._damaged(f"the attribute {name} of {inside or 'the file'}")
            return node.attrs[name]

    def encoded(self, inside: str) -> bytes | None:
        """Bytes of an encoded picture (JPEG or PNG), or None if missing.

        Raises:
            CaptureError: If the file or the dataset is damaged.
        """
        values = self._read(inside, LARGEST_PICTURE)
        if values is None:
            return None
        if values.dtype != np.uint8 or values.ndim != 1:
            raise self._damaged(inside)
        return values.tobytes()

    def head(self, inside: str, count: int) -> bytes:
        """The first bytes of an encoded picture; empty if there is none.

        Args:
            inside: Path of the dataset.
            count: Highest number of bytes.

        Raises:
            CaptureError: If the file or the dataset is damaged.
        """
        with self._guard(inside):
            node = self._dataset(inside)
            if node is None or node.dtype != np.uint8 or node.ndim != 1:
                return b""
            found = first_bytes(node, count)
        if found is None:
            raise self._damaged(inside)
        return found

    def numbers(
        self, inside: str, shape: tuple[int | None, ...] | None, holes: bool = False
    ) -> np.ndarray | None:
        """Finite float64 numbers of a dataset, or None if missing.

        Args:
            inside: Path of the dataset.
            shape: Required shape, in which None allows any length up to `MOST_ROWS`; None allows
                any shape.
            holes: Whether NaN is allowed, for unknown values.

        Raises:
            CaptureError: If the dataset has another shape or a value is not finite.
        """
        with self._guard(inside):
            node = self._dataset(inside)
            if node is None:
                return None
            if shape is not None and not _fits(node.shape, shape):
                raise CaptureError(
                    f"{self.path}: {inside} has shape {node.shape}, expected {_written(shape)}."
                )
            if math.prod(node.shape) > LARGEST // np.dtype(np.float64).itemsize:
                raise self._damaged(inside)
            values = self._values(node, inside)
        if values.dtype.kind not in "fiub" or not _sound(values, holes):
            raise CaptureError(f"{self.path}: {inside} holds values that are no finite numbers.")
        return values.astype(np.float64)

    def shape(self, inside: str) -> tuple[int, ...] | None:
        """Shape of a dataset, or None if missing."""
        with self._guard(inside):
            node = self._find(inside)
            return node.shape if _is(node, "Dataset") else None

    def pixels(self, inside: str) -> np.ndarray | None:
        """(H, W) integers of an uncompressed picture, or None if missing.

        Raises:
            CaptureError: If the file or the dataset is damaged.
        """
        values = self._read(inside)
        if values is not None and (values.ndim != 2 or values.dtype.kind != "u"):
            raise self._damaged(inside)
        return values

    def _read(self, inside: str, most: int = LARGEST) -> np.ndarray | None:
        """A whole dataset, of so many bytes at most."""
        with self._guard(inside):
            node = self._dataset(inside, most)
            return None if node is None else self._values(node, inside)

    def _values(self, node: Any, inside: str) -> np.ndarray:
        """The values of a dataset, unless far more comes of what is stored than it says."""
        if not is_bounded(node, self.path.stat().st_size):
            raise self._damaged(inside)
        return np.asarray(node[()])

    def _dataset(self, inside: str, most: int = LARGEST) -> Any:
        """A dataset that may be read, or None if missing or empty.

        Its values must lie in this file, and neither they nor a piece that is unpacked for one of
        them may be too large.
        """
        node = self._find(inside)
        if node is None or _is(node, "Group"):
            return None
        if not _is(node, "Dataset"):
            raise self._damaged(inside)
        largest = max(node.nbytes, math.prod(node.chunks or (0,)) * node.dtype.itemsize)
        if node.external or node.is_virtual or node.dtype.hasobject or largest > most:
            raise self._damaged(inside)
        return None if node.shape is None else node

    def _find(self, inside: str) -> Any:
        """A group or dataset by its path ("" is the file), or None.

        Links must not lead into other files, also not by way of a link within this one: what a
        soft link names is looked up name by name as well.
        """
        h5py, root = hdf5(PURPOSE), self._file()
        node, waiting, links = root, _names(inside), 0
        while waiting:
            part = waiting.pop()
            link = node.get(part, getlink=True) if _is(node, "Group") else None
            if link is None:
                return None
            if isinstance(link, h5py.SoftLink):
                links += 1
                path = link.path
                if links > MOST_LINKS or not isinstance(path, str) or len(path) > LONGEST_LINK:
                    raise self._damaged(inside)
                waiting += _names(path)
                node = root if path.startswith("/") else node
                continue
            if not isinstance(link, h5py.HardLink):
                raise self._damaged(inside)
            node = node[part]
        if node.file.filename != root.filename:
            raise self._damaged(inside)
        return node

    def _file(self) -> Any:
        """The open file of this process."""
        if self._opened is None or self._opened[0] != os.getpid():
            h5py = hdf5(PURPOSE)
            try:
                # No lock: data sets often lie where locks cannot be had, and nobody writes.
                self._opened = os.getpid(), h5py.File(self.path, "r", locking=False)
            except FileNotFoundError as error:
                raise CaptureError(f"{self.path} is missing.") from error
            except DAMAGED as error:
                raise CaptureError(
                    f"{self.path} is no SMC file or damaged, perhaps cut off: fetch it again."
                ) from error
        return self._opened[1]

    @contextmanager
    def _guard(self, inside: str) -> Iterator[None]:
        """Turns what h5py says of damage into one sentence."""
        try:
            yield
        except DAMAGED as error:
            raise self._damaged(inside) from error

    def _damaged(self, inside: str) -> CaptureError:
        return CaptureError(f"{self.path}: {inside} is damaged: fetch the file again.")


def _names(path: str) -> list[str]:
    """The names of a path, the last one first; "." is where one is."""
    return [name for name in reversed(path.split("/")) if name not in ("", ".")]


def _fits(found: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    """Whether a shape is the wanted one, where None stands for any length up to `MOST_ROWS`."""
    return len(found) == len(wanted) and all(
        m <= MOST_ROWS if n is None else n == m for n, m in zip(wanted, found, strict=True)
    )


def _written(shape: tuple[int | None, ...]) -> str:
    """A wanted shape, for people."""
    lengths = (f"at most {MOST_ROWS}" if n is None else str(n) for n in shape)
    return " x ".join(lengths) or "a single number"


def _sound(values: np.ndarray, holes: bool) -> bool:
    """Whether all are finite, or NaN where there may be holes."""
    return bool((np.isfinite(values) | (np.isnan(values) & holes)).all())


def _is(node: Any, kind: Literal["Group", "Dataset"]) -> bool:
    """Whether a node has names below it, or numbers in it."""
    return isinstance(node, getattr(hdf5(PURPOSE), kind))
