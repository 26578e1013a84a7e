"""Cues: which gesture is made when, until when it is held, and how speech time maps to its clip."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.clip import Clip
from ico3d.rig.quaternions import Array

BLEND_IN = 0.3
"""Seconds in which a gesture blends in at its beginning."""
BLEND_OUT = 0.4
"""Seconds in which a gesture blends out before its end."""
SETTLE = 0.15
"""Least time in seconds for which the end of a stroke is held, so that no stroke is cut off."""
TAKE_UP = 0.42
"""Least time in seconds before its stroke at which a gesture begins if hands are up already."""


@dataclass(frozen=True)
class Cue:
    """A direction to make a gesture; it is not changed once it is handed out.

    Attributes:
        number: Number of the cue, counted from 0.
        name: Name of the clip.
        mirror: Whether the clip is mirrored.
        begin: Time at which the gesture begins, seconds.
        stroke: Time at which its stroke arrives, seconds.
        skip: Seconds of the clip's beginning that are skipped.
    """

    number: int
    name: str
    mirror: bool
    begin: float
    stroke: float
    skip: float = 0.0


@dataclass(frozen=True)
class Release:
    """A direction to release a held gesture; it is not changed once it is handed out.

    Attributes:
        number: Number of the cue.
        time: Time at which the retraction begins, seconds.
    """

    number: int
    time: float


Direction = Cue | Release


def hold_end(clip: Clip, cue: Cue) -> float:
    """Time in seconds at which the hold of a cue begins, which is the earliest release."""
    return cue.stroke + (clip.marks.hold - clip.marks.stroke)


def rounded_release(clip: Clip, cue: Cue, wanted: float) -> float:
    """Earliest time, not before `wanted`, at which a cue may be released, seconds.

    A motion that is repeated in the hold is completed first.

    Args:
        clip: The clip of the cue.
        cue: The cue.
        wanted: Time in seconds.
    """
    first = hold_end(clip, cue)
    stays = SETTLE if clip.marks.release > clip.marks.hold else 0.0  # a nod has no hold
    wanted = max(wanted, cue.stroke + stays, first)
    around = clip.cycle
    if not around:
        return wanted
    return first + around * float(np.ceil((wanted - first) / around - 1e-9))


def clip_time(clip: Clip, cue: Cue, release: float | None, time: Array) -> Array:
    """(...) times of the clip that are shown at times (...) of the speech, seconds.

    Args:
        clip: The clip of the cue.
        cue: The cue.
        release: Time of the cue's release; None while it is held.
        time: (...) times of the speech.
    """
    marks = clip.marks
    rate = (marks.stroke - cue.skip) / (cue.stroke - cue.begin)
    before = cue.skip + (time - cue.begin) * rate
    first = hold_end(clip, cue)
    held = np.minimum(marks.stroke + (time - cue.stroke), marks.hold)
    around = clip.cycle
    if around:
        since = np.maximum(time - first, 0)
        held = np.where(time > first, marks.hold + since - around * np.floor(since / around), held)
    found = np.where(time < cue.stroke, before, held)
    if release is not None:
        found = np.where(time >= release, marks.release + (time - release), found)
    return np.clip(found, 0.0, marks.end)


def end_of(clip: Clip, release: float | None) -> float:
    """Time in seconds at which a cue is over; infinite while it is not released."""
    return float("inf") if release is None else release + clip.marks.end - clip.marks.release


def weight(clip: Clip, cue: Cue, release: float | None, time: Array) -> Array:
    """(...) weight of a gesture over the pose beneath it, 0 to 1, at times (...) in seconds."""
    rising = _smooth((time - cue.begin) / min(BLEND_IN, cue.stroke - cue.begin))
    if release is None:
        return rising
    return rising * _smooth((end_of(clip, release) - time) / BLEND_OUT)


def _smooth(x: Array) -> Array:
    """Smoothstep: 0 up to x = 0, 1 from x = 1, with slope 0 at both."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)
