"""Mel windows of a sound that arrives in pieces, equal to `mel_windows` of the whole sound."""

import numpy as np

from ico3d.speech.mel import (
    FFT,
    HOP,
    LEAD,
    MELS,
    WINDOW,
    mel_rows,
    pre_emphasis,
    resampling_stream,
    window_count,
    window_start,
)

_PAD = FFT // 2  # mirrored samples at both ends


class WindowStream:
    """Turns pieces of sound into encoder windows, each as soon as its last sample has arrived."""

    def __init__(self, rate: int):
        """Starts one sound.

        Args:
            rate: Samples per second of the pieces; rates other than 16 kHz need the package soxr.
        """
        self._resample = resampling_stream(rate)
        self._sound = np.zeros(0)  # (S,) pre-emphasised, padded, from the next mel row on
        self._last = 0.0  # the sample before, for the pre-emphasis
        self._num_samples = 0
        self._mel = np.zeros((0, MELS), np.float32)  # rows from `_mel_first` on
        self._mel_first = 0
        self._next = 0  # the encoder window that comes next

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Adds samples (S,) in [-1, 1]; returns the windows (n, 80, 16) that are now complete."""
        self._take(self._resample(samples, False))
        return self._windows(self._complete())

    def finish(self) -> np.ndarray:
        """Ends the sound; returns the remaining windows (n, 80, 16)."""
        self._take(self._resample(np.zeros(0, np.float32), True))
        missing = (WINDOW - 1) * HOP - self._num_samples
        if missing > 0:
            self._take(np.zeros(missing, np.float32))
        self._sound = np.pad(self._sound, (0, _PAD), mode="reflect")
        self._transform()
        total = self._mel_first + len(self._mel)
        windows = self._windows(window_count(total))
        last = self._window(window_count(total) - 1)[None]  # (1, 80, 16)
        return np.concatenate([windows, *[last] * LEAD])

    def _take(self, samples: np.ndarray) -> None:
        """Adds 16-kHz samples and computes the mel rows that they complete."""
        if len(samples) == 0:
            return
        emphasised = pre_emphasis(samples, self._last)
        self._last = float(samples[-1])
        started = self._num_samples > _PAD  # the mirrored start is in place
        self._num_samples += len(samples)
        self._sound = np.concatenate([self._sound, emphasised])
        if not started and self._num_samples > _PAD:
            self._sound = np.pad(self._sound, (_PAD, 0), mode="reflect")
        if self._num_samples > _PAD:
            self._transform()

    def _transform(self) -> None:
        """Moves complete spectra from the sound to the mel rows."""
        if len(self._sound) < FFT:
            return
        rows = mel_rows(self._sound)  # (n, 80)
        self._mel = np.concatenate([self._mel, rows])
        self._sound = self._sound[len(rows) * HOP :]

    def _complete(self) -> int:
        """How many encoder windows lie wholly within the mel rows so far."""
        count = self._next
        while window_start(count) + WINDOW <= self._mel_first + len(self._mel):
            count += 1
        return count

    def _windows(self, count: int) -> np.ndarray:
        """Windows `_next` … `count` (n, 80, 16), the first one repeated; forgets used rows."""
        windows = [self._window(index) for index in range(self._next, count)]
        if self._next == 0 and windows:
            windows = [windows[0]] * LEAD + windows
        self._next = max(self._next, count)
        # the last window of the sound may begin up to WINDOW rows before the end
        used = min(window_start(self._next), self._mel_first + len(self._mel) - WINDOW)
        self._mel = self._mel[max(0, used - self._mel_first) :]
        self._mel_first = max(self._mel_first, used)
        return np.stack(windows) if windows else np.zeros((0, MELS, WINDOW), np.float32)

    def _window(self, index: int) -> np.ndarray:
        """One window (80, 16), moved back where it would end after the sound."""
        total = self._mel_first + len(self._mel)
        start = min(window_start(index), total - WINDOW) - self._mel_first
        return self._mel[start : start + WINDOW].T
