"""Energy of sound in frequency bands over time, for comparing sounds."""

import numpy as np

FRAME = 0.02  # s
COUNT = 16
LOWEST, HIGHEST = 100.0, 6500.0  # Hz


class Bands:
    """Energies of 20 ms frames in bands of equal width on the mel scale."""

    def __init__(self, rate: int):
        """For sound of `rate` Hz; energies at different rates are comparable."""
        self.length = round(rate * FRAME)
        """Samples of a frame."""
        self._window = np.hanning(self.length)
        frequencies = np.fft.rfftfreq(self.length, 1 / rate)
        edges = _hertz(np.linspace(_mel(LOWEST), _mel(HIGHEST), COUNT + 1))
        inside = (frequencies >= edges[:-1, None]) & (frequencies < edges[1:, None])
        self._sums = inside.T / (self._window**2).sum() / self.length

    def energies(self, samples: np.ndarray) -> np.ndarray:
        """Mean squares (frames, COUNT) of samples (S,) in [-1, 1], S being whole frames."""
        frames = samples.reshape(-1, self.length) * self._window
        return np.abs(np.fft.rfft(frames)) ** 2 @ self._sums


def _mel(hertz: np.ndarray | float) -> np.ndarray:
    return 2595 * np.log10(1 + np.asarray(hertz) / 700)


def _hertz(mel: np.ndarray) -> np.ndarray:
    return 700 * (10 ** (mel / 2595) - 1)
