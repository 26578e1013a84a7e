"""Moods, which move the brows for the length of an utterance."""

import numpy as np

from ico3d.common.expression import EYE_NAMES

NEUTRAL = "neutral"
EASE = 0.4
"""Seconds of the transition between two moods."""
BROWS: dict[str, dict[str, float]] = {
    NEUTRAL: {},
    "happy": {"browInnerUp": 0.15, "browOuterUpLeft": 0.3, "browOuterUpRight": 0.3},
    "surprised": {"browInnerUp": 0.6, "browOuterUpLeft": 0.6, "browOuterUpRight": 0.6},
    "serious": {"browDownLeft": 0.35, "browDownRight": 0.35},
    "worried": {"browInnerUp": 0.6, "browDownLeft": 0.15, "browDownRight": 0.15},
    "doubtful": {"browDownLeft": 0.3, "browOuterUpRight": 0.5},
}
"""Values that each mood adds to those of the brows, by name."""


class Moods:
    """The brows of one session, with smooth transitions between moods."""

    def __init__(self):
        """Starts neutral."""
        self._from = self._to = self._wanted = brows(NEUTRAL)
        self._since = -np.inf  # s, time of the first row of this mood

    def set(self, name: str) -> None:
        """Sets the mood from the next row on."""
        self._wanted = brows(name)

    def forget(self) -> None:
        """Resets to neutral when an utterance is over; the page eases its face by itself."""
        self._from = self._to = self._wanted = brows(NEUTRAL)

    def values(self, times: np.ndarray) -> np.ndarray:
        """Values to add to those of eyes and brows.

        Args:
            times: (n,) times of the rows in seconds, ascending over all calls within an utterance.

        Returns:
            (n, 7) float32.
        """
        if len(times) and self._to is not self._wanted:
            self._from = self._at(times[:1])[0]
            self._to, self._since = self._wanted, float(times[0])
        return self._at(times)

    def _at(self, times: np.ndarray) -> np.ndarray:
        part = np.clip((times - self._since) / EASE, 0, 1)[:, None]  # (n, 1)
        eased = part * part * (3 - 2 * part)
        return (self._from + (self._to - self._from) * eased).astype(np.float32)


def brows(mood: str) -> np.ndarray:
    """(7,) float32 values that a mood adds, in the order of `EYE_NAMES`."""
    raised = BROWS[mood]
    return np.array([raised.get(name, 0.0) for name in EYE_NAMES], np.float32)
