"""When a gesture is made: cues, their releases, and which moment of the clip belongs to a time."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.clip import Clip
from ico3d.rig.quaternions import Array

BLEND_IN = 0.3
"""Seconds in which a gesture takes over."""
BLEND_OUT = 0.4
"""Seconds before its end in which it gives way."""
SETTLE = 0.15
"""Seconds that the end of a stroke stays at least: no stroke is cut off."""
TAKE_UP = 0.42
"""Seconds before the stroke from which a gesture is made when hands are up already."""


@dataclass(frozen=True)
class Cue:
    """A gesture to make; never changed once handed out.

    Attributes:
        number: Counts the cues.
        name: The clip's name.
        mirror: Whether with the other hand.
        begin: Seconds at which it begins.
        stroke: Seconds at which the stroke arrives.
        skip: Seconds of the clip's beginning that are left out.
    """

    number: int
    name: str
    mirror: bool
    begin: float
    stroke: float
    skip: float = 0.0


@dataclass(frozen=True)
class Release:
    """A gesture that is held is let go; never changed once handed out.

    Attributes:
        number: Of the cue.
        time: Seconds at which the retraction begins.
    """

    number: int
    time: float


Direction = Cue | Release


def cycle(clip: Clip) -> float:
    """Seconds of what is gone round again while a gesture is held; 0 where nothing is."""
    marks = clip.marks
    moving = any(
        np.ptp(curve.at(np.linspace(marks.hold, marks.release, 9)), axis=0).max() > 1e-2
        for curve in clip.curves.values()
    )
    return marks.release - marks.hold if moving else 0.0


def hold_end(clip: Clip, cue: Cue) -> float:
    """Seconds at which the hold begins: the earliest release."""
    return cue.stroke + (clip.marks.hold - clip.marks.stroke)


def rounded_release(clip: Clip, cue: Cue, wanted: float) -> float:
    """Seconds not before `wanted` at which a cue may be released: repetition ends where it began.

    Args:
        clip: Of the cue.
        cue: Which.
        wanted: Seconds.
    """
    first = hold_end(clip, cue)
    stays = SETTLE if clip.marks.release > clip.marks.hold else 0.0  # a nod has no hold
    wanted = max(wanted, cue.stroke + stays, first)
    around = cycle(clip)
    if not around:
        return wanted
    return first + around * float(np.ceil((wanted - first) / around - 1e-9))


def clip_time(clip: Clip, cue: Cue, release: float | None, time: Array) -> Array:
    """(...) seconds of the clip at seconds (...) of the speech."""
    marks = clip.marks
    rate = (marks.stroke - cue.skip) / (cue.stroke - cue.begin)
    before = cue.skip + (time - cue.begin) * rate
    first = hold_end(clip, cue)
    held = np.minimum(marks.stroke + (time - cue.stroke), marks.hold)
    around = cycle(clip)
    if around:
        since = np.maximum(time - first, 0)
        held = np.where(time > first, marks.hold + since - around * np.floor(since / around), held)
    found = np.where(time < cue.stroke, before, held)
    if release is not None:
        found = np.where(time >= release, marks.release + (time - release), found)
    return np.clip(found, 0.0, marks.end)


def end_of(clip: Clip, release: float | None) -> float:
    """Seconds at which a cue is over; infinite while it is held."""
    return float("inf") if release is None else release + clip.marks.end - clip.marks.release


def weight(clip: Clip, cue: Cue, release: float | None, time: Array) -> Array:
    """(...) how far a gesture prevails over what is beneath, 0 to 1, at seconds (...)."""
    rising = _smooth((time - cue.begin) / min(BLEND_IN, cue.stroke - cue.begin))
    if release is None:
        return rising
    return rising * _smooth((end_of(clip, release) - time) / BLEND_OUT)


def _smooth(x: Array) -> Array:
    """0 … 1 with zero slope at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)
