"""Rotations over time as few keys: cubic between them, 16 bits a number.

Between keys i and i + 1, h seconds apart, with v = log(q_i⁻¹ q_{i+1}) (a rotation vector), the
rotation a part s of the way is q_i · exp(p(s)), p the cubic Hermite curve from 0 to v with slopes
h·ω_i and h·ω_{i+1}. ω_i is the mean of the angular velocities before and after key i, each weighted
with the time of the other; 0 at the ends, outside of which a curve stays.
"""

from dataclasses import dataclass
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
"""Degrees that a stored curve may be off, at most, at any sample that it was made of."""
SCALE = 32767
"""int16 of 1."""
TICKS = 1000.0
"""Key times are whole milliseconds."""
LONGEST = 60.0
"""Seconds; no clip is longer."""
_SPARE = 0.01
"""Degrees that rounding to 16 bits takes of the tolerance, at most."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One role's rotation over time.

    Attributes:
        times: (K,) seconds, ascending from 0, K ≥ 1.
        rotations: (K, 4) wxyz.
    """

    times: Array
    rotations: Array

    def __post_init__(self):
        """Checks what a file may hold.

        Raises:
            ValueError: In one sentence, where it is no curve.
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
        """(..., 4) at seconds (...)."""
        times = np.asarray(times, float)
        if len(self.times) == 1:
            return np.broadcast_to(self.rotations[0], (*times.shape, 4)).copy()
        index = np.clip(
            np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2
        )
        span = self.times[index + 1] - self.times[index]
        part = np.clip((times - self.times[index]) / span, 0, 1)
        steps, slopes = _steps(self.times, self.rotations)
        s, h = part[..., None], span[..., None]
        turn = s * s * (3 - 2 * s) * steps[index]
        turn = turn + h * s * (1 - s) * ((1 - s) * slopes[index] - s * slopes[index + 1])
        return multiply(self.rotations[index], from_rotvec(turn))


def _steps(times: Array, rotations: Array) -> tuple[Array, Array]:
    """(K − 1, 3) rotation vectors from key to key, and (K, 3) angular velocities at the keys."""
    steps = to_rotvec(multiply(conjugate(rotations[:-1]), rotations[1:]))
    spans = np.diff(times)[:, None]
    speeds = steps / spans
    slopes = np.zeros((len(times), 3))
    slopes[1:-1] = (spans[1:] * speeds[:-1] + spans[:-1] * speeds[1:]) / (spans[1:] + spans[:-1])
    return steps, slopes


def angles(a: Array, b: Array) -> Array:
    """(...) degrees between rotations (..., 4)."""
    return np.degrees(np.linalg.norm(to_rotvec(multiply(conjugate(a), b)), axis=-1))


def reduced(times: Array, rotations: Array, tolerance: float = TOLERANCE) -> Curve:
    """A curve with few keys: where it is off most, between two keys, it gets another.

    Args:
        times: (F,) seconds, whole milliseconds, ascending from 0.
        rotations: (F, 4), neighbours of like sign.
        tolerance: Degrees that it may be off at these times.
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
    """(K,) uint16 milliseconds and (K, 4) int16 of a curve."""
    ticks = np.round(curve.times * TICKS).astype(np.uint16)
    return ticks, np.round(curve.rotations * SCALE).astype(np.int16)


def unpacked(ticks: np.ndarray, rotations: np.ndarray) -> Curve:
    """The curve that was packed.

    Raises:
        ValueError: If it is none.
    """
    if rotations.dtype.kind not in "iu" or ticks.dtype.kind not in "iu":
        raise ValueError("a curve's numbers are no whole ones")
    values = rotations.astype(np.float64) / SCALE
    if values.ndim != 2 or np.abs(np.linalg.norm(values, axis=-1) - 1).max(initial=0) > 1e-3:
        raise ValueError("a curve holds a rotation that is not of length 1")
    return Curve(ticks.astype(np.float64) / TICKS, continuous(normalized(values)))
