"""Finds nods and shakes of a head."""

import numpy as np

from ico3d.motion.recorded.cut import Cut
from ico3d.motion.recorded.recording import Recording
from ico3d.motion.recorded.turning_points import Swing, swings, volleys

NOD, SHAKE = 4.0, 7.0
"""Degrees that a head goes down or to the side, at least."""
LARGE = 7.0
"""Degrees from which one nod is no small one."""
SHAKES = 3
"""How often a shaken head goes from side to side, at least."""


def head_cuts(recording: Recording) -> list[Cut]:
    """Nods and shakes, in the order of time within each kind."""
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
    """The stroke arrives with the first swing; a head does not hold."""
    stroke = volley[0].end
    return Cut(name, "none", volley[0].begin, stroke, stroke, volley[-1].end)


def _down_and_up(volley: list[Swing]) -> list[list[Swing]]:
    """The part of a volley that begins downwards and ends upwards, where there is one."""
    begin = 0 if volley[0].change > 0 else 1
    part = volley[begin : begin + 2 * ((len(volley) - begin) // 2)]
    return [part] if part else []
