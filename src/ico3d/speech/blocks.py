"""Cuts sound into windows for HuBERT, whose attention would otherwise span everything (numpy).

HuBERT's output at one moment depends on all the sound that it is given. Training, whole files and
streams agree because all of them use windows of 1.2 s, of which only the rows between 0.8 s of past
and 0.2 s of future are used.
"""

import numpy as np

from ico3d.speech.mel import RATE, resampled, resampling_stream

PAST, ROWS, FUTURE = 20, 5, 5
"""Rows of a window, at 25 per second: past context, rows that are used, future context."""

ROW = RATE // 25
"""Samples per row; HuBERT gives two vectors per row."""

TAIL = 80
"""Samples behind the last row that HuBERT's last convolution reads."""

SIZE = (PAST + ROWS + FUTURE) * ROW + TAIL
"""Samples of a window."""

_QUIETEST = 1e-3
"""Deviation below which a window is not made louder: what is nearly silence stays so."""


class BlockStream:
    """Turns pieces of sound into windows, each as soon as its future context has arrived.

    Window b provides rows 5·b to 5·b + 4; row i belongs to time i/25 s.
    """

    def __init__(self, rate: int):
        """Starts one sound of `rate` samples per second; other than 16 kHz needs package soxr."""
        self._resample = resampling_stream(rate)
        self._sound = np.zeros(0, np.float32)  # from sample `_begin` on
        self._begin = 0
        self._next = 0  # the window that comes next
        self.num_samples = 0

    @property
    def num_rows(self) -> int:
        """Number of rows of the sound so far; after `finish`, of the whole sound."""
        return self.num_samples // ROW + 1

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Adds samples (S,) in [-1, 1]; returns the windows (n, SIZE) that are now complete."""
        self._take(self._resample(samples, False))
        return self._windows((self.num_samples - TAIL - FUTURE * ROW) // (ROWS * ROW))

    def finish(self) -> np.ndarray:
        """Ends the sound, pads with silence and returns the remaining windows (n, SIZE)."""
        self._take(self._resample(np.zeros(0, np.float32), True))
        return self._windows(-(-self.num_rows // ROWS))

    def _take(self, samples: np.ndarray) -> None:
        self._sound = np.concatenate([self._sound, samples])
        self.num_samples += len(samples)

    def _windows(self, count: int) -> np.ndarray:
        """Windows `_next` … `count`; forgets the sound before the one after."""
        windows = [self._window(index) for index in range(self._next, count)]
        self._next = max(self._next, count)
        begin = max(0, (self._next * ROWS - PAST) * ROW)
        self._sound = self._sound[max(0, begin - self._begin) :]
        self._begin = max(self._begin, begin)
        return np.stack(windows) if windows else np.zeros((0, SIZE), np.float32)

    def _window(self, index: int) -> np.ndarray:
        """One window (SIZE,), of mean 0 and deviation 1 where there is sound, 0 elsewhere."""
        start = (index * ROWS - PAST) * ROW
        known = self._sound[max(0, start) - self._begin : start + SIZE - self._begin]
        window = np.zeros(SIZE, np.float32)
        if len(known):
            level = max(float(known.std(dtype=np.float64)), _QUIETEST)
            window[max(0, -start) :][: len(known)] = (known - known.mean(dtype=np.float64)) / level
        return window


def sound_blocks(samples: np.ndarray, rate: int) -> tuple[np.ndarray, int]:
    """The windows (n, SIZE) of a whole sound, and the number of rows of the sound.

    Args:
        samples: (S,) in [-1, 1].
        rate: Samples per second; rates other than 16 kHz need the package soxr.
    """
    stream = BlockStream(RATE)
    windows = [stream.push(resampled(samples, rate)), stream.finish()]
    return np.concatenate(windows), stream.num_rows
