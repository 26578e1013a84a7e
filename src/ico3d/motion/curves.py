"""Rotations over time as curves with few keys, stored with 16 bits per number.

Let keys i and i + 1 be h seconds apart, and v = log(q_i⁻¹ q_{i+1}) the rotation vector between
them. At a share s of the time between them the rotation is q_i · exp(p(s)), where p is the cubic
Hermite curve from 0 to v with slopes h·ω_i and h·ω_{i+1}. The angular velocity ω_i is the mean of
those before and after key i, each weighted by the duration of the other; it is 0 at the first and
last key. Before the first and after the last key a curve is constant.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ico3d.rig.quaternions import (
    Array,
    conjugate,
    continuous,
    from_rotvec,
    multiply,
    normalized,
    to_rotvec,
)

TOLERANCE = 0.5
"""Default of the largest error of a stored curve at the samples it was made from, degrees."""
SCALE = 32767
"""The int16 that stands for 1."""
TICKS = 1000.0
"""Ticks per second of stored key times, which are whole milliseconds."""
LONGEST = 60.0
"""Longest duration of a curve, seconds."""
_SPARE = 0.01
"""Part of the tolerance, in degrees, that is reserved for rounding to 16 bits."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A rotation over time, given by K ≥ 1 keys.

    Attributes:
        times: (K,) seconds, ascending from 0.
        rotations: (K, 4) unit quaternions wxyz.
    """

    times: Array
    rotations: Array

    def __post_init__(self):
        """Checks shapes and values, which may come from a file.

        Raises:
            ValueError: If they do not make a curve.
        """
        times, rotations = self.times, self.rotations
        if times.ndim != 1 or not len(times) or rotations.shape != (len(times), 4):
            raise ValueError("a curve has as many rotations wxyz as times, and one at least")
        if not (np.isfinite(times).all() and np.isfinite(rotations).all()):
            raise ValueError("a curve holds NaN or infinity")
        if times[0] != 0 or times[-1] > LONGEST or not (np.diff(times) > 0).all():
            raise ValueError(f"a curve's times begin at 0 and ascend, to {LONGEST:g} s at most")
        if np.abs(np.linalg.norm(rotations, axis=-1) - 1).max() > 1e-3:
            raise ValueError("a curve holds a rotation that is not of length 1")

    def at(self, times: Array | float) -> Array:
        """(..., 4) rotations wxyz at times (...) in seconds."""
        times = np.asarray(times, float)
        if len(self.times) == 1:
            return np.broadcast_to(self.rotations[0], (*times.shape, 4)).copy()
        index = np.clip(
            np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2
        )
        span = self.times[index + 1] - self.times[index]
        part = np.clip((times - self.times[index]) / span, 0, 1)
        steps, slopes = self._steps  # (K − 1, 3), (K, 3)
        s, h = part[..., None], span[..., None]  # (..., 1)
        turn = s * s * (3 - 2 * s) * steps[index]
        turn = turn + h * s * (1 - s) * ((1 - s) * slopes[index] - s * slopes[index + 1])
        return multiply(self.rotations[index], from_rotvec(turn))

    @cached_property
    def _steps(self) -> tuple[Array, Array]:
        """(K − 1, 3) rotation vectors from key to key, and (K, 3) velocities at the keys."""
        before, after = self.rotations[:-1], self.rotations[1:]
        steps = to_rotvec(multiply(conjugate(before), after))
        spans = np.diff(self.times)[:, None]
        speeds = steps / spans
        slopes = np.zeros((len(self.times), 3))
        mean = (spans[1:] * speeds[:-1] + spans[:-1] * speeds[1:]) / (spans[1:] + spans[:-1])
        slopes[1:-1] = mean
        return steps, slopes


def angles(a: Array, b: Array) -> Array:
    """(...) angles in degrees between rotations (..., 4)."""
    return np.degrees(np.linalg.norm(to_rotvec(multiply(conjugate(a), b)), axis=-1))


def reduced(times: Array, rotations: Array, tolerance: float = TOLERANCE) -> Curve:
    """A curve with few keys through sampled rotations.

    Between two keys another key is added where the error is largest, until it is small enough.

    Args:
        times: (F,) seconds in whole milliseconds, ascending from 0.
        rotations: (F, 4) wxyz, with signs that do not jump between neighbours.
        tolerance: Largest error at these times, degrees.
    """
    if angles(rotations[:1], rotations).max() <= tolerance - _SPARE:
        return Curve(times[:1], rotations[:1])
    chosen = np.zeros(len(times), bool)
    chosen[[0, -1]] = True
    while True:
        found = Curve(times[chosen], rotations[chosen])
        off = angles(found.at(times), rotations)
        if off.max() <= tolerance - _SPARE:
            return found
        keys = np.flatnonzero(chosen)
        for first, last in pairwise(keys):
            worst = first + int(np.argmax(off[first : last + 1]))
            if off[worst] > tolerance - _SPARE:
                chosen[worst] = True


def packed(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """A curve as it is stored: times (K,) uint16 in milliseconds, rotations (K, 4) int16."""
    ticks = np.round(curve.times * TICKS).astype(np.uint16)
    return ticks, np.round(curve.rotations * SCALE).astype(np.int16)


def unpacked(ticks: np.ndarray, rotations: np.ndarray) -> Curve:
    """The curve of stored times (K,) in milliseconds and rotations (K, 4) of whole numbers.

    Raises:
        ValueError: If they do not make a curve.
    """
    if rotations.dtype.kind not in "iu" or ticks.dtype.kind not in "iu":
        raise ValueError("a curve's numbers are no whole ones")
    values = rotations.astype(np.float64) / SCALE
    if values.ndim != 2 or np.abs(np.linalg.norm(values, axis=-1) - 1).max(initial=0) > 1e-3:
        raise ValueError("a curve holds a rotation that is not of length 1")
    return Curve(ticks.astype(np.float64) / TICKS, continuous(normalized(values)))
