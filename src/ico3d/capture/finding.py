"""One line of a capture's examination."""

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "warn", "error"]


@dataclass(frozen=True)
class Finding:
    """What was found.

    Attributes:
        what: What was examined.
        level: `ok`, or how bad it is.
        text: The finding in words.
    """

    what: str
    level: Level
    text: str


def missing_and_damaged(
    what: str, total: int, missing: list[tuple[str, int]], damaged: list[tuple[str, int]]
) -> Finding:
    """A finding about files that each belong to a camera and a frame.

    Args:
        what: What was examined.
        total: How many files there should be.
        missing: (camera, frame) of those that are not there; a capture may lack views.
        damaged: (camera, frame) of those that cannot be pictures.
    """
    parts = [
        f"{word}: camera {faults[0][0]}, frame {faults[0][1]}"
        + (f" (and {len(faults) - 1} more)" if faults[1:] else "")
        for word, faults in (("damaged", damaged), ("missing", missing))
        if faults
    ]
    level: Level = "error" if damaged or len(missing) == total else "warn" if missing else "ok"
    return Finding(what, level, "; ".join(parts) or f"all {total} are there")
