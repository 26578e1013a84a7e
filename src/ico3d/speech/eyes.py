"""Random but natural blinks and brow movements of an avatar (numpy).

The timing of blinks is defined here for both the server and the page: the page, which blinks at
rest and in speech, gets the numbers as generated TypeScript (`ico3d.chat.generating.shared`).
"""

import numpy as np

from ico3d.common.expression import EYE_NAMES, LIDS

PAUSE_MEDIAN, PAUSE_SPREAD = 3.4, 0.35
"""Median of the seconds between blinks, and the standard deviation of their logarithm.

The median gives 17 blinks a minute, the mean rate of people at rest, whose rates are log-normally
distributed (Bentivoglio et al. 1997, Movement Disorders 12:1028).
"""
SHORTEST_PAUSE, LONGEST_PAUSE = 2.0, 6.0
"""Limits of the seconds between blinks, which prevent staring and fluttering."""
CLOSING = 0.07
"""Seconds in which lids close; in spontaneous blinks 66 ms.

Voluntary blinks close in 77.6 ms, 17.6% more ("Kinematic comparison of spontaneously generated
blinks and voluntary blinks in normal adult subjects").
"""
CLOSED = 0.03
"""Seconds for which lids stay closed; in people about 10 ms.

With a shorter time, at 25 rows per second, some blinks would fall between two rows.
"""
OPENING = 0.1
"""Seconds in which lids open.

Closing is 40 to 47% faster than opening (Sforza et al. 2008, Ophthalmic and Physiological Optics
28:345).
"""
_BROW_BASE, _BROW_SWING = 0.06, 0.04  # of brow raises; brows are lowered by half as much
_BROW_PERIODS = (4.3, 7.1, 11.9)  # s
_BLOCK = 64  # blinks drawn at once

_RAISES = [EYE_NAMES.index(f"brow{n}") for n in ("InnerUp", "OuterUpLeft", "OuterUpRight")]
_FROWNS = [EYE_NAMES.index(f"browDown{side}") for side in ("Left", "Right")]


class EyeBehaviour:
    """Blinks at random intervals, and slow small movements of the brows.

    The values are a function of seed and time, independent of the frame rate.
    """

    def __init__(self, seed: int):
        """Seeds the random numbers; blinks are drawn later, as far as times are asked for."""
        self._random = np.random.default_rng(seed)
        self._phases = self._random.uniform(0, 2 * np.pi, (2, len(_BROW_PERIODS)))
        self._blinks = np.zeros(0)  # (n,) s, when lids begin to close

    def values(self, times: np.ndarray) -> np.ndarray:
        """The seven values of `EYE_NAMES` at the given times, in any order.

        Args:
            times: (T,) seconds, ≥ 0.

        Returns:
            (T, 7) float32 in [0, 1].
        """
        times = np.asarray(times, np.float64)
        values = np.zeros((len(times), len(EYE_NAMES)), np.float32)
        values[:, LIDS] = self._lids(times)[:, None]
        raised, lowered = self._brows(times)
        values[:, _RAISES] = raised[:, None]
        values[:, _FROWNS] = lowered[:, None]
        return values

    def blink_times(self, end: float) -> np.ndarray:
        """(n,) seconds at which lids begin to close, at least up to time `end`."""
        while len(self._blinks) == 0 or self._blinks[-1] <= end:
            pauses = PAUSE_MEDIAN * np.exp(PAUSE_SPREAD * self._random.standard_normal(_BLOCK))
            pauses = np.clip(pauses, SHORTEST_PAUSE, LONGEST_PAUSE)
            last = self._blinks[-1] if len(self._blinks) else 0.0
            self._blinks = np.concatenate([self._blinks, last + np.cumsum(pauses)])
        return self._blinks

    def _lids(self, times: np.ndarray) -> np.ndarray:
        """(T,) 0 open … 1 closed."""
        if len(times) == 0:
            return np.zeros(0)
        blinks = self.blink_times(float(times.max()))
        index = np.searchsorted(blinks, times, side="right") - 1  # (T,) the last blink begun
        since = np.where(index >= 0, times - blinks[np.maximum(index, 0)], np.inf)
        closing = np.clip(since / CLOSING, 0, 1)
        opening = np.clip((since - CLOSING - CLOSED) / OPENING, 0, 1)
        return _eased(closing) - _eased(opening)

    def _brows(self, times: np.ndarray) -> np.ndarray:
        """(2, T) how far brows are raised and lowered."""
        angles = 2 * np.pi * times[:, None] / np.array(_BROW_PERIODS)  # (T, 3)
        swing = np.sin(angles + self._phases[:, None]).mean(-1)  # (2, T) in [-1, 1]
        return (_BROW_BASE + _BROW_SWING * swing) * np.array([[1.0], [0.5]])


def _eased(x: np.ndarray) -> np.ndarray:
    """0 … 1 with zero slope at both ends."""
    return x * x * (3 - 2 * x)
