"""Bounds the heads of safetensors files, which anybody may have written."""

from pathlib import Path

MOST_HEAD, MOST_TENSORS = 16 << 20, 10_000
"""Bytes of what a file says of its tensors and of itself, and how many tensors it may have: for
each of them more than a kilobyte of memory is taken, whatever it holds."""


def check_head(path: Path) -> None:
    """Refuses a file whose head takes much memory, before it is opened.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the head is longer than `MOST_HEAD`, or names more than `MOST_TENSORS`.
    """
    with path.open("rb") as file:
        size = int.from_bytes(file.read(8), "little")
        if size > MOST_HEAD or file.read(size).count(b'"dtype"') > MOST_TENSORS:
            raise ValueError("its head is larger than those of models")
