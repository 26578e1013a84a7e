"""Arms and legs that reach where hands and feet are to be: two bones and a hinge."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.turning import across, dot, unit
from ico3d.rig.quaternions import Array

REACH = 0.998
"""Longest part of a limb's length that it stretches to: a hinge never locks."""
LEAST = 0.2
"""Shortest part of it: elbows and knees do not fold flat."""


@dataclass(frozen=True)
class Bend:
    """How the two bones of a limb lie.

    Attributes:
        upper: (..., 3) unit direction of the upper bone.
        lower: (..., 3) of the lower bone.
        hinge: (..., 3) axis about which upper turns to lower; at right angles to both.
    """

    upper: Array
    lower: Array
    hinge: Array


def reach(start: Array, end: Array, lengths: tuple[float, float], pole: Array) -> Bend:
    """Two bones from `start` towards `end` (law of cosines), the joint between moved to `pole`.

    Args:
        start: (..., 3).
        end: (..., 3); where it is farther or nearer than the limb goes, it only points there.
        lengths: Metres of the upper and of the lower bone.
        pole: (..., 3) direction in which elbow or knee points.
    """
    first, second = lengths
    whole = first + second
    between = end - start
    along = unit(between)
    distance = np.clip(np.sqrt(dot(between, between)), LEAST * whole, REACH * whole)[..., None]
    sideways = across(pole, along)
    cosine = (first**2 + distance**2 - second**2) / (2 * first * distance)
    joint = first * (cosine * along + np.sqrt(np.maximum(1 - cosine**2, 0)) * sideways)
    return Bend(unit(joint), unit(distance * along - joint), np.cross(sideways, along))
