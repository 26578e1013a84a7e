"""Finds nods and shakes of the head in a recording."""

import numpy as np

from ico3d.motion.recorded.cut import Cut
from ico3d.motion.recorded.recording import Recording
from ico3d.motion.recorded.turning_points import Swing, swings, volleys

NOD, SHAKE = 4.0, 7.0
"""Least degrees by which a head turns down in a nod, and to the side in a shake."""
LARGE = 7.0
"""Degrees from which a single nod is not a small one."""
SHAKES = 3
"""Least number of swings from side to side in a shake."""


def head_cuts(recording: Recording) -> list[Cut]:
    """Nods and shakes of a recording: all nods in order of time, then all shakes."""
    degrees = np.degrees(recording.head)  # (F, 3)
    down, aside = (degrees[:, axis] for axis in (0, 1))
    shakes = [
        _cut("shake", volley)
        for volley in volleys(swings(aside, SHAKE), recording)
        if len(volley) >= SHAKES
    ]
    nods = [
        _cut("small_nod" if len(nod) == 2 and nod[0].change < LARGE else "nod", nod)
        for volley in volleys(swings(down, NOD), recording)
        for nod in _down_and_up(volley)
    ]
    alone = [nod for nod in nods if not any(nod.overlaps(shake) for shake in shakes)]
    return alone + shakes


def _cut(name: str, volley: list[Swing]) -> Cut:
    """A cut of the head: its stroke arrives with the end of the first swing, without a hold."""
    stroke = volley[0].end
    return Cut(name, "none", volley[0].begin, stroke, stroke, volley[-1].end)


def _down_and_up(volley: list[Swing]) -> list[list[Swing]]:
    """A list of the part of a volley that begins downwards and ends upwards; empty if none does."""
    begin = 0 if volley[0].change > 0 else 1
    part = volley[begin : begin + 2 * ((len(volley) - begin) // 2)]
    return [part] if part else []
