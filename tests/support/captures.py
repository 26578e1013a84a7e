"""Captures that are made in memory, opened by verbs as if they lay in a folder."""

from collections.abc import Callable
from pathlib import Path

import pytest

from ico3d.capture import formats
from ico3d.capture.capture import Capture


def open_with(patch: pytest.MonkeyPatch, read: Callable[[Path], Capture]) -> None:
    """Lets every path be opened as a capture by `read`, as long as `patch` lasts."""
    every = formats.Format("any path", lambda path: True, read)
    patch.setattr(formats, "FORMATS", (every,))
