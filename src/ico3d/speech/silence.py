"""Silence closes the mouth: how far each row of expressions counts (numpy).

Encoders answer to the faintest hiss (a spectrum is a matter of shape, HuBERT even normalises its
input), and the adaptor of a head makes some half-open mouth of it. So what a sound says fades out
where there is next to no sound.
"""

import numpy as np

from ico3d.speech.mel import FPS

SILENT, HEARD = -60.0, -50.0
"""Levels (dB of the root mean square, 0 for ±1) up to which nothing and from which all counts."""

_REACH = 2
"""Rows to either side whose sound counts: 0.2 s in all, longer than the silence of a t or p."""


class SilenceGate:
    """Factors 0 to 1, one per row, of a sound that arrives in pieces."""

    def __init__(self, rate: int):
        """Starts one sound of `rate` samples per second."""
        self._rate = rate
        self._pending = np.zeros(0, np.float64)  # squares of the row that is not complete
        self._energy = np.zeros(_REACH)  # sum of squares of each row, two of silence before
        self._first = -_REACH  # the row of its first entry

    def push(self, samples: np.ndarray) -> None:
        """Takes the next samples (S,) in [-1, 1]."""
        squares = np.asarray(samples, np.float64) ** 2
        self._pending = np.concatenate([self._pending, squares])
        while len(self._pending) >= (size := self._size(self._first + len(self._energy))):
            self._energy = np.append(self._energy, self._pending[:size].sum())
            self._pending = self._pending[size:]

    def finish(self) -> None:
        """Ends the sound: silence follows."""
        self._energy = np.append(self._energy, self._pending.sum())
        self._pending = self._pending[:0]

    def gains(self, first: int, count: int) -> np.ndarray:
        """Factors (count,) of the rows from `first` on; forgets the sound before them.

        The sound must be there until two rows after the last of them, or be finished.
        """
        window = 2 * _REACH + 1
        energy = self._energy[first - _REACH - self._first :]
        energy = np.pad(energy, (0, max(0, count + window - 1 - len(energy))))
        self._energy, self._first = energy, first - _REACH
        sums = np.lib.stride_tricks.sliding_window_view(energy, window)[:count].sum(1)  # (count,)
        level = 10 * np.log10(sums * FPS / (window * self._rate) + 1e-12)
        part = np.clip((level - SILENT) / (HEARD - SILENT), 0, 1)
        return (part * part * (3 - 2 * part)).astype(np.float32)

    def _size(self, row: int) -> int:
        """Samples of a row."""
        return int((row + 1) * self._rate // FPS) - int(row * self._rate // FPS)
