"""What a check has found, in words."""

from dataclasses import dataclass
from typing import Literal

from rich.text import Text

from ico3d.errors import printable

Grade = Literal["good", "weak", "bad"]
MARKS: dict[Grade, tuple[str, str]] = {
    "good": ("✓", "green"),
    "weak": ("!", "yellow"),
    "bad": ("✗", "red"),
}


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        grade: `good`; `weak` for what works and could be better; `bad` for what visitors notice, or
            what should not be reachable.
        what: What was found.
        mend: What to do about it; empty if it is good.
    """

    grade: Grade
    what: str
    mend: str = ""

    def line(self) -> Text:
        """The finding for a terminal."""
        mark, colour = MARKS[self.grade]
        told = f"{self.what}: {self.mend}" if self.mend else self.what
        return Text.assemble((mark, colour), f" {printable(told)}")


def good(what: str) -> Finding:
    """Something that is as it should be."""
    return Finding("good", what)


def weak(what: str, mend: str) -> Finding:
    """Something that works and could be better."""
    return Finding("weak", what, mend)


def bad(what: str, mend: str) -> Finding:
    """Something to mend before visitors come."""
    return Finding("bad", what, mend)
