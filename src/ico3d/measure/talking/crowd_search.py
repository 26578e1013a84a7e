"""Searches for the number of visitors that a server bears at once."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from websockets.exceptions import WebSocketException

from ico3d.measure.talking import crowd

AHEAD = 150.0  # ms by which each piece of speech is to be there before it is played
FIRST = 10  # visitors, who are tried first
CLOSE = 0.1  # share of the number within which the answer lies


@dataclass(frozen=True)
class Trial:
    """What one number of visitors heard.

    Attributes:
        visitors: Number of visitors at once.
        own: How many of them heard their own tone and no other.
        ahead: Milliseconds by which the latest piece of speech was early; None if somebody's
            answer did not come at all.
    """

    visitors: int
    own: int
    ahead: float | None

    @property
    def borne(self) -> bool:
        """Whether everybody heard their own voice in time."""
        return self.own == self.visitors and self.ahead is not None and self.ahead >= AHEAD

    @property
    def told(self) -> str:
        """What was heard, in words."""
        if self.ahead is None:
            return "somebody got no answer"
        own = f"{self.own} heard their own voice only"
        return f"{own}, the latest piece {self.ahead:.0f} ms before it was played"


def tried(bundle: Path, visitors: int, microphones: int) -> Trial:
    """Has so many visitors talk at once; as many microphones are open as there are visitors."""
    try:
        visits = crowd.measure(bundle, visitors, min(microphones, visitors))
    except (TimeoutError, WebSocketException):
        return Trial(visitors, 0, None)
    if not all(visit.ahead for visit in visits):
        return Trial(visitors, 0, None)
    found = crowd.figures(visits)
    return Trial(visitors, found["heard_their_own_tone_only"], found["ahead_ms"]["least"])


def search(trial: Callable[[int], Trial], most: int = crowd.MOST) -> list[Trial]:
    """Doubles the number of visitors until they are too many, then halves the distance.

    Args:
        trial: Lets so many visitors talk.
        most: No more are tried.

    Returns:
        All trials, in order.
    """
    trials, borne, many = [], 0, most + 1
    while many - borne > max(1, CLOSE * borne):
        between = (borne + many) // 2
        number = between if many <= most else min(most, 2 * borne or FIRST)
        trials.append(trial(number))
        if trials[-1].borne:
            borne = number
        else:
            many = number
    return trials


def most_borne(trials: list[Trial]) -> int:
    """The largest number of visitors that was borne; 0 if none was."""
    return max((one.visitors for one in trials if one.borne), default=0)
