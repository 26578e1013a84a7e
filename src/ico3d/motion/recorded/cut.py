"""A cut: from which frame to which somebody made a gesture, and what it is called."""

from dataclasses import dataclass

REST = "rest"
"""The cut of somebody who stands with calm hands."""


@dataclass(frozen=True)
class Cut:
    """A span of recorded frames.

    Attributes:
        name: What it means.
        first: The frame at which it begins.
        stroke: The frame at which its stroke arrives.
        release: The frame until which the end of the stroke is held, or repeated.
        last: The frame at which it is over.
        hands: Whose gesture it is: `left`, `right`, both, or none: the head's.
    """

    name: str
    first: int
    stroke: int
    release: int
    last: int
    hands: tuple[str, ...] = ()

    def overlaps(self, other: "Cut") -> bool:
        """Whether they share a frame."""
        return self.first <= other.last and self.last >= other.first
