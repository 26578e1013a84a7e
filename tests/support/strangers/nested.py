"""Folders nested so deep that Python's stack ends where a function calls itself for each."""

import inspect
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

DEEP, STACK = 400, 200
"""Number of folders, and of calls that Python allows meanwhile: fewer of both are faster."""


@contextmanager
def nested(folder: Path) -> Iterator[None]:
    """While it lasts, they lie in a folder."""
    for _ in range(DEEP):
        (folder := folder / "d").mkdir()
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(len(inspect.stack(0)) + STACK)
    try:
        yield
    finally:
        sys.setrecursionlimit(before)
