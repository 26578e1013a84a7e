"""Turning points of values over time, swings between them, and runs of True."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ico3d.motion.recorded.recording import Recording
from ico3d.rig.quaternions import Array

STILL = 0.15
"""A swing extends over steps that are larger than this share of its fastest step."""
QUICK = (0.06, 0.45)
"""Least and longest duration in seconds of a swing of a hand or the head."""
PAUSE = 0.2
"""Longest pause in seconds between two swings of a volley."""


def turning_points(values: Array, least: float) -> list[int]:
    """Indices of alternating maxima and minima of values (F,).

    Between successive ones, values change by `least` or more. The first and the last need such a
    change on one side only; without any such change there are no turning points.
    """
    found: list[int] = []
    low = high = direction = 0  # direction: 1 up, −1 down, 0 before the first large change
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
    """First and last index of each run of True in (F,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]])))
    return [(first, after - 1) for first, after in edges.reshape(-1, 2).tolist()]


@dataclass(frozen=True)
class Swing:
    """A change of values from one turning point towards the next.

    Attributes:
        begin: Frame at which the change begins.
        end: Frame at which the change ends.
        change: Value at the end less value at the beginning.
    """

    begin: int
    end: int
    change: float


def swings(values: Array, least: float) -> list[Swing]:
    """Swings of values (F,) by `least` or more.

    A swing is the run of quick steps around the fastest step between two turning points; slow drift
    before and after does not belong to it.
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
    """Groups of swings that follow each other without long pauses.

    Swings that are too short or too long for people (`QUICK`) are left out, and end a group.
    """
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
