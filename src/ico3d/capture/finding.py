"""One line of a capture's examination."""

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "warn", "error"]


@dataclass(frozen=True)
class Finding:
    """What was found.

    Attributes:
        what: What was examined.
        level: How it is.
        text: The finding.
    """

    what: str
    level: Level
    text: str
