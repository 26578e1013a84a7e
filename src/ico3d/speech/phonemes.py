"""What a voice tells about its phonemes, as rows for a speech model (numpy)."""

from collections.abc import Sequence

import numpy as np

from ico3d.common.espeak.speech import Phoneme
from ico3d.speech.articulation import ARTICULATION, articulation_track
from ico3d.speech.mel import FPS

PAUSE = ""


class TimedPhonemes:
    """The phonemes of the stretches of a sound that a voice has told."""

    def __init__(self):
        """Starts a sound of which nothing is known."""
        self._phonemes: list[Phoneme] = []
        self._stretches: list[tuple[float, float]] = []

    def add(self, phonemes: Sequence[Phoneme], start: float, seconds: float) -> None:
        """Adds a stretch behind all others.

        Args:
            phonemes: The phonemes in order; their times count from the start of the stretch.
            start: Where the stretch begins in the sound, seconds.
            seconds: How long it lasts.
        """
        self._phonemes += [Phoneme(start + p.time, p.symbol) for p in phonemes if p.time < seconds]
        self._phonemes.append(Phoneme(start + seconds, PAUSE))
        self._stretches.append((start, start + seconds))

    def rows(self, first: int, count: int) -> np.ndarray | None:
        """What is known of rows `first` to `first` + `count` − 1, at 25 per second.

        Returns:
            (count, 6) float32: the articulation of lips, and 1 where it is known; None if it is
            known nowhere.
        """
        times = (first + np.arange(count)) / FPS
        known = np.zeros(count, bool)
        for start, end in self._stretches:
            known |= (times >= start) & (times < end)
        if not known.any():
            return None
        end = self._phonemes[-1].time
        values = articulation_track(self._phonemes, end, np.maximum(times, 0))  # (count, 5)
        told = np.concatenate([values, np.ones((count, 1), np.float32)], 1)
        assert told.shape[1] == len(ARTICULATION) + 1
        return (told * known[:, None]).astype(np.float32)
