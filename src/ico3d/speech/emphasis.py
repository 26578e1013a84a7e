"""Brows that rise with the syllables a voice stresses (numpy).

People raise their brows at words that matter, mostly with an accent of the voice, and begin some
60 ms before it (Flecha-García 2010, "Eyebrow raises in dialogue and their relation to discourse
structure, utterance function and pitch accents in English", Speech Communication 52:542).
"""

import numpy as np

from ico3d.common.expression import EYE_NAMES
from ico3d.speech.mel import FPS

SILENT = -50.0
"""Level of a row in dB of full scale below which nobody speaks."""
LOUDER = 4.0
"""How much louder than the speech before a syllable is that counts as stressed, dB."""
FULL = 10.0
"""From how many dB on a stroke is highest."""
HEIGHTS = (0.22, 0.5)
"""Lowest and highest stroke, as shares of the way from brows at rest to the highest seen."""
PAUSE = 2.0
"""Least time in seconds between two strokes."""
MEMORY = 1.5
"""Seconds over which the loudness of speech is averaged."""
RISE, FALL = 0.16, 0.70
"""Seconds in which brows rise and sink."""
AHEAD = 2
"""How many rows before its stressed syllable a stroke begins: 80 ms."""
NEEDED = AHEAD + 1
"""Rows of sound beyond the last wanted row that are looked at where they are known."""

_RAISED = np.array([name.startswith("brow") and "Down" not in name for name in EYE_NAMES])


class Emphasis:
    """The brows' strokes in one voice; the sound may come in pieces."""

    def __init__(self):
        """Starts with silence."""
        self._mean: float | None = None  # dB, of the speech so far
        self._strokes: list[tuple[float, float]] = []  # (begin in seconds, height), the last two

    def values(self, times: np.ndarray, sound: np.ndarray, rate: int) -> np.ndarray:
        """Values to add to those of eyes and brows.

        Args:
            times: (n,) times of rows in seconds, 25 per second, ascending over all calls.
            sound: (S,) samples in [-1, 1] from the first row's time on: of these rows and, where it
                is known, of the `NEEDED` rows after them.
            rate: Samples per second.

        Returns:
            (n, 7) float32, 0 for lids.
        """
        levels = _levels(sound, rate)
        # Who was interrupted speaks anew at a time for which rows were made before.
        self._strokes = [stroke for stroke in self._strokes if len(times) and stroke[0] < times[0]]
        raised = np.zeros(len(times))
        for row, time in enumerate(times):
            self._hear(levels[row : row + 1])
            height = self._stress(levels[max(0, row + AHEAD - 1) : row + AHEAD + 2])
            last = self._strokes[-1][0] if self._strokes else -np.inf
            if height > 0 and time - last >= PAUSE:
                self._strokes = [*self._strokes[-1:], (float(time), height)]
            raised[row] = max((h * _stroke(time - begin) for begin, h in self._strokes), default=0)
        return (raised[:, None] * _RAISED).astype(np.float32)

    def _hear(self, level: np.ndarray) -> None:
        """Averages the loudness of speech."""
        if len(level) == 0 or level[0] <= SILENT:
            return
        before = level[0] if self._mean is None else self._mean
        self._mean = float(before + (level[0] - before) / (MEMORY * FPS))

    def _stress(self, levels: np.ndarray) -> float:
        """Height of the stroke that belongs to the middle of three levels; 0 without a stress."""
        if len(levels) < 3 or self._mean is None:
            return 0.0
        if levels[1] < levels[0] or levels[1] < levels[2]:
            return 0.0
        above = levels[1] - self._mean - LOUDER
        low, high = HEIGHTS
        return low + (high - low) * min(1.0, above / (FULL - LOUDER)) if above > 0 else 0.0


def _levels(sound: np.ndarray, rate: int) -> np.ndarray:
    """(m,) level of each whole row of a sound in dB of full scale."""
    size = round(rate / FPS)
    rows = np.asarray(sound[: len(sound) // size * size], np.float64).reshape(-1, size)
    return 10 * np.log10(np.maximum((rows**2).mean(1), 1e-12))


def _stroke(since: float) -> float:
    """Height of a stroke, 0 to 1, some seconds after it began."""
    up = min(max(since / RISE, 0.0), 1.0)
    down = min(max((since - RISE) / FALL, 0.0), 1.0)
    return up * up * (3 - 2 * up) - down * down * (3 - 2 * down)
