"""Bounds the heads of safetensors files, which anybody may have written."""

import os
from pathlib import Path

import numpy as np
from safetensors.numpy import load

MOST_HEAD, MOST_TENSORS = 16 << 20, 10_000
"""Bytes of what a file says of its tensors and of itself, and how many tensors it may have, fewer
if the latter has brackets: for each more than a kilobyte of memory is taken."""
MOST_RATIO, FREE = 8, 1 << 20
"""So many times what a disk stores of it may a file take, and so many bytes more: a mapped hole
becomes memory, which of a temporary file system stays taken when the program has ended."""
SMALL_HEAD = 1 << 20
"""Bytes of a head that is parsed here: what it says becomes thirty times as much."""


def check_head(path: Path, most: int = MOST_HEAD) -> bytes:
    """Refuses a file whose head takes much memory, before it is opened; the head, which is JSON.

    Args:
        path: The file.
        most: Bytes that its head may have.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the head is longer, or names more than `MOST_TENSORS`, or the file is but a
            hole.
    """
    with path.open("rb") as file:
        _check_stored(os.fstat(file.fileno()))
        size = int.from_bytes(file.read(8), "little")
        head = file.read(min(size, most))
    _check(size, head, most)
    return head


def _check_stored(about: os.stat_result) -> None:
    stored = 512 * getattr(about, "st_blocks", 0)  # 0 where a system does not tell
    if stored and about.st_size > MOST_RATIO * stored + FREE:
        times = about.st_size // stored
        raise ValueError(f"it claims {times} times what the disk stores of it")


def bounded_head(content: bytes, most: int = SMALL_HEAD) -> bytes:
    """The head of a file's content, which is JSON.

    Raises:
        ValueError: If it is longer than `most`, or names more than `MOST_TENSORS`.
    """
    size = int.from_bytes(content[:8], "little")
    head = content[8 : 8 + min(size, most)]
    _check(size, head, most)
    return head


def load_bounded(content: bytes) -> dict[str, np.ndarray]:
    """The tensors of a file's content by name.

    Raises:
        SafetensorError: If the file is damaged.
        ValueError: If its head is longer than `MOST_HEAD`, or names more than `MOST_TENSORS`.
    """
    bounded_head(content, MOST_HEAD)
    return load(content)


def _check(size: int, head: bytes, most: int) -> None:
    # each tensor has two lists, shape and place; words can be escaped or left out, brackets cannot
    if size > most or head.count(b"[") > 2 * MOST_TENSORS:
        raise ValueError("its head is larger than those of models")
