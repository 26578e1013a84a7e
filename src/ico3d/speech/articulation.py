"""Mouth shapes and lip articulation over time, from phonemes.

The built-in encoder learns to tell them, and voices that know their phonemes drive lips by them.
"""

from collections.abc import Sequence

import numpy as np

from ico3d.common.espeak.speech import Phoneme
from ico3d.common.visemes import VISEMES, visemes

ARTICULATION = ("opening", "spread", "rounding", "closure", "labiodental")
"""Lip values, 0 to 1: lips apart, corners apart, lips forward, closed (p b m), on teeth (f v)."""

_STEP = 0.005  # s, the grid on which sounds are laid out
_SPREAD = np.array([0.030, 0.040, 0.045, 0.015, 0.018])  # s, how far each value blends in time

# opening, spread, rounding, and how firmly the sound holds them against its neighbours
_SHAPES = {
    "sil": (0.0, 0.2, 0.0, 1.0),
    "PP": (0.0, 0.2, 0.0, 3.0),
    "FF": (0.1, 0.3, 0.0, 2.0),
    "TH": (0.25, 0.3, 0.0, 0.8),
    "DD": (0.2, 0.3, 0.0, 0.5),
    "kk": (0.3, 0.3, 0.0, 0.4),
    "CH": (0.25, 0.1, 0.7, 1.2),
    "SS": (0.12, 0.5, 0.0, 1.0),
    "nn": (0.2, 0.3, 0.0, 0.5),
    "RR": (0.25, 0.2, 0.35, 0.7),
    "aa": (1.0, 0.3, 0.0, 1.0),
    "E": (0.6, 0.6, 0.0, 1.0),
    "ih": (0.35, 0.8, 0.0, 1.0),
    "oh": (0.6, 0.1, 0.7, 1.2),
    "ou": (0.3, 0.0, 1.0, 1.5),
}


def viseme_track(phonemes: Sequence[Phoneme], end: float, times: np.ndarray) -> np.ndarray:
    """Index of the viseme at each of the given times.

    Args:
        phonemes: Phonemes in order of time.
        end: Time in seconds at which the last phoneme ends; before the first phoneme and after this
            time there is silence.
        times: (T,) seconds.

    Returns:
        (T,) int64 indices into `VISEMES`.
    """
    starts, shapes = _segments(phonemes, end)
    return shapes[np.searchsorted(starts, times, side="right")]


def articulation_track(phonemes: Sequence[Phoneme], end: float, times: np.ndarray) -> np.ndarray:
    """How open, spread, rounded and closed the lips are at the given times.

    Each phoneme has target values. Neighbouring phonemes blend under symmetric windows, so that
    movements are neither early nor late.

    Args:
        phonemes: Phonemes in order of time.
        end: Time in seconds at which the last phoneme ends.
        times: (T,) seconds.

    Returns:
        (T, 5) float32, columns as in `ARTICULATION`.
    """
    grid = np.arange(0, max(end, float(np.max(times, initial=0.0))) + 0.2, _STEP)  # (G,)
    shapes = viseme_track(phonemes, end, grid)  # (G,)
    table = np.array([_SHAPES[name] for name in VISEMES])  # (15, 4)
    wanted, strength = table[shapes, :3], table[shapes, 3:]  # (G, 3), (G, 1)
    columns = []
    for column in range(3):
        weighted = _blurred(wanted[:, column] * strength[:, 0], _SPREAD[column])
        columns.append(weighted / _blurred(strength[:, 0], _SPREAD[column]))
    for column, name in ((3, "PP"), (4, "FF")):
        made = (shapes == VISEMES.index(name)).astype(float)
        columns.append(_blurred(made, _SPREAD[column]))
    values = [np.interp(times, grid, column) for column in columns]
    return np.stack(values, axis=1).astype(np.float32)  # (T, 5)


def _segments(phonemes: Sequence[Phoneme], end: float) -> tuple[np.ndarray, np.ndarray]:
    """Where shapes begin (n,) and the shapes (n + 1,), the first one before any begins."""
    silence = VISEMES.index("sil")
    starts, shapes = [], [silence]
    times = [phoneme.time for phoneme in phonemes] + [end]
    for index, phoneme in enumerate(phonemes):
        names = visemes(phoneme.symbol)
        for part, name in enumerate(names):
            starts.append(times[index] + (times[index + 1] - times[index]) * part / len(names))
            shapes.append(VISEMES.index(name))
    return np.array([*starts, end]), np.array([*shapes, silence])


def _blurred(values: np.ndarray, deviation: float) -> np.ndarray:
    """(G,) values under a Gaussian window, the ends held."""
    half = int(3 * deviation / _STEP) + 1
    window = np.exp(-0.5 * (np.arange(-half, half + 1) * _STEP / deviation) ** 2)
    return np.convolve(np.pad(values, half, mode="edge"), window / window.sum(), mode="valid")
