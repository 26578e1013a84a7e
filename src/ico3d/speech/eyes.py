"""Eyes and brows: smoothing of tracked values and behaviour for an avatar that speaks (numpy)."""

import numpy as np

from ico3d.common.expression import EYE_NAMES

_SHORTEST, _LONGEST = 2.0, 6.0  # s from one blink to the next
_MEDIAN, _SPREAD = 3.4, 0.35  # s and log deviation of the pauses between blinks
_CLOSING, _CLOSED, _OPENING = 0.07, 0.02, 0.09  # s
_BROW_BASE, _BROW_SWING = 0.06, 0.04  # of brow raises; brows are lowered by half as much
_BROW_PERIODS = (4.3, 7.1, 11.9)  # s
_BLOCK = 64  # blinks drawn at once

_BLINKS = [EYE_NAMES.index(f"eyeBlink{side}") for side in ("Left", "Right")]
_RAISES = [EYE_NAMES.index(f"brow{n}") for n in ("InnerUp", "OuterUpLeft", "OuterUpRight")]
_FROWNS = [EYE_NAMES.index(f"browDown{side}") for side in ("Left", "Right")]


def smooth_eyes(values: np.ndarray) -> np.ndarray:
    """Savitzky–Golay filter (5 rows, cubic) of each column, as tracked values need it.

    Args:
        values: (T, C), one row per frame.

    Returns:
        (T, C) float64; the two rows at each end lie on the cubic through the five outermost.
        Fewer than five rows come back as they are.
    """
    values = np.asarray(values, np.float64)
    if len(values) < 5:
        return values.copy()
    powers = np.vander(np.arange(-2, 3), 4).astype(np.float64)  # (5, 4)
    fit = powers @ np.linalg.pinv(powers)  # (5, 5): five values to the cubic's
    windows = np.lib.stride_tricks.sliding_window_view(values, 5, axis=0)  # (T − 4, C, 5)
    return np.concatenate([fit[:2] @ values[:5], windows @ fit[2], fit[3:] @ values[-5:]])


class EyeBehaviour:
    """Blinks at natural, random intervals and slow small brow motion.

    The same seed gives the same behaviour; it is a function of time, whatever the frame rate.
    """

    def __init__(self, seed: int):
        """Draws the brows' phases; blinks are drawn as far as times are asked for."""
        self._random = np.random.default_rng(seed)
        self._phases = self._random.uniform(0, 2 * np.pi, (2, len(_BROW_PERIODS)))
        self._blinks = np.zeros(0)  # (n,) s, when lids begin to close

    def values(self, times: np.ndarray) -> np.ndarray:
        """The seven values of `EYE_NAMES` at any times.

        Args:
            times: (T,) seconds, ≥ 0.

        Returns:
            (T, 7) float32 in [0, 1].
        """
        times = np.asarray(times, np.float64)
        values = np.zeros((len(times), len(EYE_NAMES)), np.float32)
        values[:, _BLINKS] = self._lids(times)[:, None]
        raised, lowered = self._brows(times)
        values[:, _RAISES] = raised[:, None]
        values[:, _FROWNS] = lowered[:, None]
        return values

    def blink_times(self, end: float) -> np.ndarray:
        """(n,) seconds at which lids begin to close, until at least `end`."""
        while len(self._blinks) == 0 or self._blinks[-1] <= end:
            pauses = _MEDIAN * np.exp(_SPREAD * self._random.standard_normal(_BLOCK))
            pauses = np.clip(pauses, _SHORTEST, _LONGEST)
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
        closing = np.clip(since / _CLOSING, 0, 1)
        opening = np.clip((since - _CLOSING - _CLOSED) / _OPENING, 0, 1)
        return _eased(closing) - _eased(opening)

    def _brows(self, times: np.ndarray) -> np.ndarray:
        """(2, T) how far brows are raised and lowered."""
        angles = 2 * np.pi * times[:, None] / np.array(_BROW_PERIODS)  # (T, 3)
        swing = np.sin(angles + self._phases[:, None]).mean(-1)  # (2, T) in [-1, 1]
        return (_BROW_BASE + _BROW_SWING * swing) * np.array([[1.0], [0.5]])


def _eased(x: np.ndarray) -> np.ndarray:
    """0 … 1 with zero slope at both ends."""
    return x * x * (3 - 2 * x)
