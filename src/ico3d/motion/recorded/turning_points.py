"""Where values that go up and down turn around, and where conditions hold."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ico3d.motion.recorded.recording import Recording
from ico3d.rig.quaternions import Array

STILL = 0.15
"""Part of the fastest step down to which a change has begun or goes on."""
QUICK = (0.06, 0.45)
"""Seconds that a hand or a head takes from one side to the other."""
PAUSE = 0.2
"""Seconds that it stays on a side, at most."""


def turning_points(values: Array, least: float) -> list[int]:
    """Numbers of the highs and lows, in turn, between which values (F,) change by `least` or more.

    The first one and the last one need such a change on one side only; without any there are none.
    """
    found: list[int] = []
    low = high = direction = 0  # up is 1; nobody knows before the first change
    for i, value in enumerate(values):
        if direction >= 0 and value > values[high]:
            high = i
        if direction <= 0 and value < values[low]:
            low = i
        if direction >= 0 and value <= values[high] - least:
            found.append(high)
            direction, low = -1, i
        elif direction <= 0 and value >= values[low] + least:
            found.append(low)
            direction, high = 1, i
    return [*found, high if direction > 0 else low] if found else []


def runs(there: np.ndarray) -> list[tuple[int, int]]:
    """First and last number of each stretch of True in (F,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]])))
    return [(first, after - 1) for first, after in edges.reshape(-1, 2).tolist()]


@dataclass(frozen=True)
class Swing:
    """A change from one turning point towards the next.

    Attributes:
        begin: The frame at which it begins to change.
        end: The frame at which it stays again.
        change: By how much.
    """

    begin: int
    end: int
    change: float


def swings(values: Array, least: float) -> list[Swing]:
    """Changes of values (F,) by `least` or more, around the fastest step between two turns.

    What drifts before and after does not belong to them.
    """
    found = [_swing(values, *pair) for pair in pairwise(turning_points(values, least))]
    return [swing for swing in found if abs(swing.change) >= least]


def _swing(values: Array, first: int, last: int) -> Swing:
    steps = np.diff(values[first : last + 1]) * np.sign(values[last] - values[first])
    begin = end = int(np.argmax(steps))
    still = STILL * steps[begin]
    while begin > 0 and steps[begin - 1] > still:
        begin -= 1
    while end < len(steps) and steps[end] > still:
        end += 1
    begin, end = first + begin, first + end
    return Swing(begin, end, float(values[end] - values[begin]))


def volleys(found: list[Swing], recording: Recording) -> list[list[Swing]]:
    """Swings as quick as people's that follow one another at once."""
    least, most, pause = map(recording.frames, (*QUICK, PAUSE))
    groups: list[list[Swing]] = [[]]
    for swing in found:
        if groups[-1] and swing.begin - groups[-1][-1].end > pause:
            groups.append([])
        if least <= swing.end - swing.begin <= most:
            groups[-1].append(swing)
        else:
            groups.append([])
    return [group for group in groups if group]
