"""Moods, which move brows and smile for a sentence, or for the length of an utterance."""

import numpy as np

from ico3d.common.expression import FACE_NAMES
from ico3d.motion.composing.lexicon import called_for

NEUTRAL = "neutral"
LONGEST = 1_000
"""Letters of a sentence that are looked at."""
EASE = 0.4
"""Seconds of the transition between two moods."""
FACES: dict[str, dict[str, float]] = {
    NEUTRAL: {},
    "happy": {
        "browInnerUp": 0.15,
        "browOuterUpLeft": 0.3,
        "browOuterUpRight": 0.3,
        "eyeBlinkLeft": 0.16,  # cheeks that a smile raises narrow the eyes
        "eyeBlinkRight": 0.16,
        "smile": 1.0,
    },
    "surprised": {
        "browInnerUp": 0.6,
        "browOuterUpLeft": 0.6,
        "browOuterUpRight": 0.6,
        "smile": 0.2,
    },
    "serious": {"browDownLeft": 0.35, "browDownRight": 0.35},
    "worried": {"browInnerUp": 0.6, "browDownLeft": 0.15, "browDownRight": 0.15},
    "doubtful": {"browDownLeft": 0.3, "browOuterUpRight": 0.5},
}
"""Values that each mood adds to those of the face, by name."""
WITH_GESTURES = {
    "wave": "happy",
    "welcome": "happy",
    "hand_on_heart": "happy",
    "shrug": "doubtful",
    "think": "doubtful",
}
"""The mood of a sentence whose words call for a gesture: the face takes part in what hands do."""


class Moods:
    """Brows and smile of one session, with smooth transitions between moods."""

    def __init__(self):
        """Starts neutral."""
        self._from = self._to = self._wanted = face_of(NEUTRAL)
        self._since = -np.inf  # s, time of the first row of this mood
        self._chosen = False  # by who answers, for the rest of the utterance

    def set(self, name: str) -> None:
        """Sets the mood from the next row to the end of the utterance."""
        self._wanted, self._chosen = face_of(name), True

    def hear(self, sentence: str) -> None:
        """Sets the mood from the next row on by the words of a sentence, unless one was chosen.

        A sentence that calls for none has half of what the one before it had: moods fade.
        """
        if not self._chosen:
            called = called_for(sentence[:LONGEST])
            found = (WITH_GESTURES.get(gesture) for gesture in called)
            mood = next((mood for mood in found if mood), None)
            self._wanted = face_of(mood) if mood else 0.5 * self._wanted

    def forget(self) -> None:
        """Resets to neutral when an utterance is over; the page eases its face by itself."""
        self._from = self._to = self._wanted = face_of(NEUTRAL)
        self._chosen = False

    def values(self, times: np.ndarray) -> np.ndarray:
        """Values to add to those of the face.

        Args:
            times: (n,) times of the rows in seconds, ascending over all calls within an utterance.

        Returns:
            (n, 8) float32, in the order of `FACE_NAMES`.
        """
        if len(times) and self._to is not self._wanted:
            self._from = self._at(times[:1])[0]
            self._to, self._since = self._wanted, float(times[0])
        return self._at(times)

    def _at(self, times: np.ndarray) -> np.ndarray:
        part = np.clip((times - self._since) / EASE, 0, 1)[:, None]  # (n, 1)
        eased = part * part * (3 - 2 * part)
        return (self._from + (self._to - self._from) * eased).astype(np.float32)


def face_of(mood: str) -> np.ndarray:
    """(8,) float32 values that a mood adds, in the order of `FACE_NAMES`."""
    added = FACES[mood]
    return np.array([added.get(name, 0.0) for name in FACE_NAMES], np.float32)
