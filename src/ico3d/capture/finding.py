"""Findings: the lines that `ico3d capture check` prints."""

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "warn", "error"]


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Attributes:
        what: What was checked.
        level: `ok`, `warn` or `error`.
        text: The result in words.
    """

    what: str
    level: Level
    text: str


def missing_and_damaged(
    what: str,
    total: int,
    missing: list[tuple[str, int]],
    damaged: list[tuple[str, int]],
    further: int = 0,
) -> Finding:
    """A finding about files of which there is one for each camera and frame.

    Args:
        what: What was checked.
        total: Number of files that there should be.
        missing: Pairs (camera, frame) without a file, which is allowed, as captures may lack views.
        damaged: Pairs (camera, frame) whose file cannot be a picture.
        further: Number of missing ones that are not in `missing`.
    """
    parts = [
        f"{word}: camera {faults[0][0]}, frame {faults[0][1]}"
        + (f" (and {more} more)" if (more := len(faults) - 1 + beside) else "")
        for word, faults, beside in (("damaged", damaged, 0), ("missing", missing, further))
        if faults
    ]
    level: Level = (
        "error" if damaged or len(missing) + further == total else "warn" if missing else "ok"
    )
    return Finding(what, level, "; ".join(parts) or f"all {total} are there")
