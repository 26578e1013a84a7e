"""Spans of a body's time."""

from typing import Protocol


class Span(Protocol):
    """Frames first … last, both included."""

    @property
    def first(self) -> int:
        """The first frame."""
        ...

    @property
    def last(self) -> int:
        """The last frame."""
        ...
