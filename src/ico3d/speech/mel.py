"""Sound to mel windows, as SyncTalk's audio-visual encoder expects them; numpy only."""

import functools
from collections.abc import Callable
from types import ModuleType
from typing import TypeVar

import numpy as np

from ico3d.errors import MissingExtraError

RATE = 16_000  # samples per second of the sound that goes in
HOP = 200  # samples from one mel row to the next: 80 rows per second
FFT = 800  # samples in one spectrum
MELS = 80
WINDOW = 16  # mel rows in one encoder window: 0.2 s
LEAD = 2  # row i looks at window i - LEAD, so that the window is centred on the row
FPS = 25.0  # windows per second

_Index = TypeVar("_Index", int, np.ndarray)

_PRE_EMPHASIS = 0.97
_LOWEST, _HIGHEST = 55.0, 7600.0  # Hz
_FLOOR = 1e-5  # magnitude, -100 dB
_REFERENCE, _MIN_DB, _LIMIT = 20.0, 100.0, 4.0


def mel_spectrogram(samples: np.ndarray) -> np.ndarray:
    """Normalised log-mel spectrum of a whole sound.

    Args:
        samples: (S,) in [-1, 1] at 16 kHz, S > 400.

    Returns:
        (1 + S // 200, 80) float32 in [-4, 4]; row m is centred on sample 200·m. The sound is
        mirrored at both ends.
    """
    padded = np.pad(pre_emphasis(samples), FFT // 2, mode="reflect")  # (S + 800,)
    return mel_rows(padded)


def pre_emphasis(samples: np.ndarray, previous: float = 0.0) -> np.ndarray:
    """y_n = x_n − 0.97·x_{n−1}, where `previous` precedes the first sample."""
    samples = np.asarray(samples, np.float64)
    return samples - _PRE_EMPHASIS * np.concatenate([[previous], samples[:-1]])


def mel_rows(emphasised: np.ndarray) -> np.ndarray:
    """Mel rows of all complete spectra in a piece of pre-emphasised sound.

    Args:
        emphasised: (S,) samples; row m covers samples 200·m to 200·m + 799.

    Returns:
        (1 + (S − 800) // 200, 80) float32.
    """
    frames = np.lib.stride_tricks.sliding_window_view(emphasised, FFT)[::HOP]  # (T, 800)
    spectrum = np.abs(np.fft.rfft(frames * _hann(), axis=1))  # (T, 401)
    level = 20 * np.log10(np.maximum(_FLOOR, spectrum @ _filters().T)) - _REFERENCE  # (T, 80)
    scaled = 2 * _LIMIT * (level + _MIN_DB) / _MIN_DB - _LIMIT
    return np.clip(scaled, -_LIMIT, _LIMIT).astype(np.float32)


def window_count(num_rows: int) -> int:
    """Number of encoder windows in `num_rows` mel rows, without the repeated ones at the ends."""
    return (num_rows - WINDOW) * 5 // 16 + 2  # 5/16 windows per mel row: 25 fps / 80 rows per s


def window_start(index: _Index) -> _Index:
    """First mel row of encoder window `index`: int(3.2·index)."""
    return index * 16 // 5


def mel_windows(samples: np.ndarray, rate: int) -> np.ndarray:
    """Encoder inputs of a whole sound, one per 25-fps frame.

    Row i belongs to time i/25 s and covers 0.2 s of mel rows around that time, which is window i −
    2. The first and the last window are repeated twice each.

    Args:
        samples: (S,) in [-1, 1]; a sound shorter than one window is followed by silence.
        rate: Samples per second; rates other than 16 kHz need the package soxr.

    Returns:
        (T, 80, 16) float32, T ≥ ⌊25·seconds⌋ + 1.
    """
    sound = resampled(samples, rate)
    shortest = (WINDOW - 1) * HOP
    mel = mel_spectrogram(np.pad(sound, (0, max(0, shortest - len(sound)))))  # (M, 80)
    count = window_count(len(mel))
    window = np.clip(np.arange(-LEAD, count + LEAD), 0, count - 1)  # (T,) window of each row
    start = np.minimum(window_start(window), len(mel) - WINDOW)  # (T,)
    rows = start[:, None] + np.arange(WINDOW)  # (T, 16)
    return np.ascontiguousarray(mel[rows].transpose(0, 2, 1))  # (T, 80, 16)


def resampled(samples: np.ndarray, rate: int) -> np.ndarray:
    """Resamples a sound (S,) from `rate` samples per second to 16 kHz, float32.

    Raises:
        MissingExtraError: If `rate` is not 16 kHz and soxr is not installed.
    """
    samples = np.asarray(samples, np.float32)
    if rate == RATE:
        return samples
    return soxr().resample(samples, rate, RATE)


def resampling_stream(rate: int) -> Callable[[np.ndarray, bool], np.ndarray]:
    """A function that resamples consecutive pieces of one sound to 16 kHz.

    Returns:
        A function that takes the next samples (S,) and whether they are the last ones; until the
        last call its output may lag behind.

    Raises:
        MissingExtraError: If `rate` is not 16 kHz and soxr is not installed.
    """
    if rate == RATE:
        return lambda samples, last: np.asarray(samples, np.float32)
    stream = soxr().ResampleStream(rate, RATE, 1, dtype="float32")
    return lambda samples, last: stream.resample_chunk(np.asarray(samples, np.float32), last=last)


def soxr() -> ModuleType:
    """Imports the resampling package soxr.

    Raises:
        MissingExtraError: If soxr is not installed.
    """
    try:
        import soxr
    except ImportError:
        raise MissingExtraError("soxr", "chat", f"sound that is not at {RATE} Hz") from None
    return soxr


@functools.cache
def _hann() -> np.ndarray:
    """(800,) periodic Hann window."""
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(FFT) / FFT)


@functools.cache
def _filters() -> np.ndarray:
    """(80, 401) triangular filters on the Slaney mel scale, each of unit area."""
    bins = np.arange(FFT // 2 + 1) * RATE / FFT  # (401,) Hz
    edges = _hertz(np.linspace(_mel(_LOWEST), _mel(_HIGHEST), MELS + 2))  # (82,)
    width = np.diff(edges)  # (81,)
    rising = (bins - edges[:-2, None]) / width[:-1, None]  # (80, 401)
    falling = (edges[2:, None] - bins) / width[1:, None]  # (80, 401)
    area = 2 / (edges[2:] - edges[:-2])  # (80,)
    return np.maximum(0, np.minimum(rising, falling)) * area[:, None]


_LINEAR_STEP = 200 / 3  # Hz per mel below 1 kHz
_LOG_STEP = np.log(6.4) / 27  # above it, 27 mels per factor of 6.4


def _mel(hertz: float) -> float:
    """Slaney's mel scale."""
    if hertz < 1000:
        return hertz / _LINEAR_STEP
    return float(1000 / _LINEAR_STEP + np.log(hertz / 1000) / _LOG_STEP)


def _hertz(mel: np.ndarray) -> np.ndarray:
    """The inverse of `_mel`."""
    knee = 1000 / _LINEAR_STEP
    return np.where(mel < knee, mel * _LINEAR_STEP, 1000 * np.exp(_LOG_STEP * (mel - knee)))
