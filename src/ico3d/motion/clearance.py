"""Keeps hands out of the body: trunk and head are modelled as rounded solids."""

import numpy as np

from ico3d.motion.person import Person
from ico3d.motion.roles import SIDES
from ico3d.motion.turning import dot
from ico3d.rig.quaternions import Array

HEAD = np.array([0.0, 0.022, -0.005])
"""(3,) from the head's joint to the middle of the head, relative to `Person.height`."""
THIGHS, COLLAR = 0.17, 0.05
"""How far the trunk reaches below the hips, and ends below the shoulders, relative to height."""
DEPTH = 0.01
"""How far the trunk's axis lies in front of the shoulders, relative to height."""


def _trunk(person: Person) -> tuple[Array, Array, Array]:
    """(3,) lower end and (3,) upper end of the trunk's axis, and (3,) half extents; metres."""
    shoulders = np.mean([person.place(f"{side}_shoulder") for side in SIDES], axis=0)
    lower = np.array([0.0, person.place("hips")[1] - THIGHS * person.height, shoulders[2]])
    upper = np.array([0.0, shoulders[1] - COLLAR * person.height, shoulders[2]])
    lower[2] = upper[2] = shoulders[2] + DEPTH * person.height
    width, depth = person.thickness.torso
    return lower, upper, person.height * np.array([width, COLLAR, depth])


def _outside(offset: Array, extents: Array) -> Array:
    """(..., 3) displacements that move points out of an ellipsoid; 0 for points outside.

    Args:
        offset: (..., 3) points relative to the ellipsoid's centre.
        extents: (3,) half axes.
    """
    scaled = offset / extents
    size = np.sqrt(dot(scaled, scaled))[..., None]
    gradient = scaled / extents  # at right angles to the surface
    steep = np.sqrt(dot(gradient, gradient))[..., None]
    depth = np.maximum(1 - size, 0) * size / np.maximum(steep, 1e-9)
    return depth * gradient / np.maximum(steep, 1e-9)


def way_out_of_trunk(person: Person, points: Array, radius: float) -> Array:
    """(..., 3) displacements in metres that move points of a limb out of the trunk.

    Args:
        person: Whose trunk.
        points: (..., 3) metres, in rest space as it moves with the chest.
        radius: Radius of the limb, metres.

    Returns:
        (..., 3); 0 for points outside.
    """
    lower, upper, extents = _trunk(person)
    nearest = np.clip(points[..., 1], lower[1], upper[1])[..., None]
    axis = lower + (upper - lower) * (nearest - lower[1]) / (upper[1] - lower[1])
    return _outside(points - axis, extents + radius)


def way_out_of_head(person: Person, points: Array, radius: float) -> Array:
    """(..., 3) displacements in metres that move points of a limb out of the head.

    Args:
        person: Whose head.
        points: (..., 3) metres, in rest space as it moves with the head.
        radius: Radius of the limb, metres.

    Returns:
        (..., 3); 0 for points outside.
    """
    middle = person.place("head") + person.height * HEAD
    extents = person.height * np.array(person.thickness.head)
    return _outside(points - middle, extents + radius)
