"""Windows of sound for HuBERT, whose attention would otherwise see the whole recording (numpy).

What HuBERT says about a moment depends on all the sound that it is given. So that training, whole
files and streams agree, it is always given the same: windows of 1.2 s, of which the rows between
0.8 s of past and 0.2 s of future are taken.
"""

import numpy as np

from ico3d.speech.mel import RATE, resampled, resampling_stream

PAST, ROWS, FUTURE = 20, 5, 5
"""25-fps rows of a window: context, those that are taken, look-ahead."""

ROW = RATE // 25
"""Samples of a row; HuBERT gives two vectors for it."""

TAIL = 80
"""Samples that its last convolution sees beyond the last row."""

SIZE = (PAST + ROWS + FUTURE) * ROW + TAIL
"""Samples of a window."""

_QUIETEST = 1e-3
"""Deviation below which a window is not made louder: what is nearly silence stays so."""


class BlockStream:
    """Turns pieces of sound into windows as soon as their look-ahead is there.

    Window b stands for rows [5·b, 5·b + 5); row i belongs to time i/25 s.
    """

    def __init__(self, rate: int):
        """Starts one sound; a rate other than 16 kHz needs the package soxr."""
        self._resample = resampling_stream(rate)
        self._sound = np.zeros(0, np.float32)  # from sample `_begin` on
        self._begin = 0
        self._next = 0  # the window that comes next
        self.num_samples = 0

    @property
    def num_rows(self) -> int:
        """Rows of the sound so far, which are those of the whole when it has ended."""
        return self.num_samples // ROW + 1

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Takes the next samples (S,) in [-1, 1]; returns the windows (n, SIZE) now complete."""
        self._take(self._resample(samples, False))
        return self._windows((self.num_samples - TAIL - FUTURE * ROW) // (ROWS * ROW))

    def finish(self) -> np.ndarray:
        """Ends the sound; returns the windows (n, SIZE) that remain, silence after it."""
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
    """The windows (n, SIZE) of a whole sound, and how many rows it has."""
    stream = BlockStream(RATE)
    windows = [stream.push(resampled(samples, rate)), stream.finish()]
    return np.concatenate(windows), stream.num_rows
