"""Inverse kinematics of arms and legs: two bones and a hinge."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.turning import across, dot, unit
from ico3d.rig.quaternions import Array

REACH = 0.998
"""Largest distance of a limb's ends, relative to its length: the hinge never locks."""
LEAST = 0.2
"""Least distance of a limb's ends, relative to its length: the hinge never folds flat."""


@dataclass(frozen=True)
class Bend:
    """Directions of the two bones of a limb.

    Attributes:
        upper: (..., 3) unit direction of the upper bone.
        lower: (..., 3) unit direction of the lower bone.
        hinge: (..., 3) unit axis of the hinge, about which `upper` turns to `lower`.
    """

    upper: Array
    lower: Array
    hinge: Array


def reach(start: Array, end: Array, lengths: tuple[float, float], pole: Array) -> Bend:
    """Directions of two bones that reach from `start` to `end`, by the law of cosines.

    Args:
        start: (..., 3) shoulder or hip, metres.
        end: (..., 3) wrist or ankle, metres; if it is out of reach, the limb only points there.
        lengths: Lengths of the upper and the lower bone, metres.
        pole: (..., 3) direction in which elbow or knee points.
    """
    first, second = lengths
    whole = first + second
    between = end - start
    along = unit(between)
    distance = np.clip(np.sqrt(dot(between, between)), LEAST * whole, REACH * whole)[..., None]
    sideways = across(pole, along)
    cosine = (first**2 + distance**2 - second**2) / (2 * first * distance)
    joint = first * (cosine * along + np.sqrt(np.maximum(1 - cosine**2, 0)) * sideways)  # (..., 3)
    return Bend(unit(joint), unit(distance * along - joint), np.cross(sideways, along))
