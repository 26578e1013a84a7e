"""Closes the mouth in silence: a factor for each row of expression values (numpy).

Encoders react to the faintest hiss, because a spectrum is normalised and HuBERT even normalises its
input. The adaptor of a head would turn that into a half-open mouth. Expression values are therefore
faded out where there is next to no sound.
"""

import numpy as np

from ico3d.speech.mel import FPS

SILENT, HEARD = -60.0, -50.0
"""Levels in dB (RMS, 0 for ±1) up to which the factor is 0, and from which on the factor is 1."""

_REACH = 2
"""Rows to either side whose sound counts: 0.2 s in all, longer than the silence of a t or p."""


class SilenceGate:
    """Factors 0 to 1, one per row at 25 rows per second, for a sound that arrives in pieces."""

    def __init__(self, rate: int):
        """Starts one sound of `rate` samples per second."""
        self._rate = rate
        self._pending = np.zeros(0, np.float64)  # squares of the row that is not complete
        self._energy = np.zeros(_REACH)  # sum of squares of each row, two of silence before
        self._first = -_REACH  # the row of its first entry

    def push(self, samples: np.ndarray) -> None:
        """Adds samples (S,) in [-1, 1]."""
        squares = np.asarray(samples, np.float64) ** 2
        self._pending = np.concatenate([self._pending, squares])
        while len(self._pending) >= (size := self._size(self._first + len(self._energy))):
            self._energy = np.append(self._energy, self._pending[:size].sum())
            self._pending = self._pending[size:]

    def finish(self) -> None:
        """Ends the sound; silence follows."""
        self._energy = np.append(self._energy, self._pending.sum())
        self._pending = self._pending[:0]

    def gains(self, first: int, count: int) -> np.ndarray:
        """Factors (count,) of `count` rows from row `first` on; earlier sound is forgotten.

        The sound must have arrived up to two rows behind the last of these rows, or have ended.
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
