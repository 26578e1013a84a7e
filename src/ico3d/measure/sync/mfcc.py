"""Mel-frequency cepstral coefficients, as the package python_speech_features defines them."""

from functools import cache

import numpy as np
from scipy.fft import dct

RATE = 16_000
"""Samples per second."""
WINDOW, HOP, FFT = 400, 160, 512
"""Samples of a window (25 ms), from a window to the next (10 ms), and of the Fourier transform."""
FILTERS, COEFFICIENTS, LIFTER, PRE_EMPHASIS = 26, 13, 22, 0.97
_LEAST = np.finfo(float).eps


def mfcc(samples: np.ndarray) -> np.ndarray:
    """Coefficients of a sound with the defaults of python_speech_features 0.6.

    Rectangular windows, power spectra, triangular filters from 0 Hz to 8 kHz whose corners are
    rounded down to bins, logarithm, orthonormal cosine transform, sinusoidal lifter; the logarithm
    of the window's energy stands in place of coefficient 0.

    Args:
        samples: (S,) numbers of the size of int16 at 16 kHz, at least one.

    Returns:
        (T, 13), 100 rows per second; the last window is filled up with zeros.
    """
    sound = np.asarray(samples, np.float64)
    sound = np.append(sound[0], sound[1:] - PRE_EMPHASIS * sound[:-1])  # (S,)
    count = 1 + max(0, -(-(len(sound) - WINDOW) // HOP))
    padded = np.zeros((count - 1) * HOP + WINDOW)
    padded[: len(sound)] = sound[: len(padded)]
    windows = np.lib.stride_tricks.sliding_window_view(padded, WINDOW)[::HOP]  # (T, 400)
    power = np.abs(np.fft.rfft(windows, FFT)) ** 2 / FFT  # (T, 257)
    energies = power @ _filters().T  # (T, 26)
    bands = np.log(np.where(energies == 0, _LEAST, energies))  # (T, 26)
    rows = np.asarray(dct(bands, type=2, axis=1, norm="ortho"))[:, :COEFFICIENTS]  # (T, 13)
    rows *= 1 + LIFTER / 2 * np.sin(np.pi * np.arange(COEFFICIENTS) / LIFTER)
    total = power.sum(1)  # (T,)
    rows[:, 0] = np.log(np.where(total == 0, _LEAST, total))
    return rows


@cache
def _filters() -> np.ndarray:
    """(26, 257) triangular filters, equally wide in mel."""
    highest = 2595 * np.log10(1 + RATE / 2 / 700)
    hertz = 700 * (10 ** (np.linspace(0, highest, FILTERS + 2) / 2595) - 1)  # (28,)
    corners = np.floor((FFT + 1) * hertz / RATE)
    bins = np.arange(FFT // 2 + 1)
    low, middle, high = corners[:-2, None], corners[1:-1, None], corners[2:, None]  # (26, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        rising, falling = (
            (bins - low) / (middle - low),
            (high - bins) / (high - middle),
        )  # (26, 257)
    inside = np.where((bins >= low) & (bins < middle), rising, 0.0)
    return np.where((bins >= middle) & (bins < high), falling, inside)
