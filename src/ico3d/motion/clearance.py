"""Hands do not go through the body: trunk and head as rounded solids of the person's size."""

import numpy as np

from ico3d.motion.person import Person
from ico3d.motion.roles import SIDES
from ico3d.motion.turning import dot
from ico3d.rig.quaternions import Array

HEAD = np.array([0.0, 0.022, -0.005])
"""From the head's joint to the middle of the head, in heights."""
THIGHS, COLLAR = 0.17, 0.05
"""Heights that the trunk reaches below the hips, and ends below the shoulders."""
DEPTH = 0.01
"""Heights that the trunk's middle lies before the shoulders."""


def _trunk(person: Person) -> tuple[Array, Array, Array]:
    """(3,) lower and upper end of the trunk's axis, and (3,) its half extents, in metres."""
    shoulders = np.mean([person.place(f"{side}_shoulder") for side in SIDES], axis=0)
    lower = np.array([0.0, person.place("hips")[1] - THIGHS * person.height, shoulders[2]])
    upper = np.array([0.0, shoulders[1] - COLLAR * person.height, shoulders[2]])
    lower[2] = upper[2] = shoulders[2] + DEPTH * person.height
    width, depth = person.thickness.torso
    return lower, upper, person.height * np.array([width, COLLAR, depth])


def _outside(offset: Array, extents: Array) -> Array:
    """(..., 3) the way out of an ellipsoid for points (..., 3) from its middle; 0 outside."""
    scaled = offset / extents
    size = np.sqrt(dot(scaled, scaled))[..., None]
    gradient = scaled / extents  # at right angles to the surface
    steep = np.sqrt(dot(gradient, gradient))[..., None]
    depth = np.maximum(1 - size, 0) * size / np.maximum(steep, 1e-9)
    return depth * gradient / np.maximum(steep, 1e-9)


def way_out_of_trunk(person: Person, points: Array, radius: float) -> Array:
    """(..., 3) metres that take points of a limb out of the trunk; 0 where they are outside.

    Args:
        person: Whose trunk.
        points: (..., 3) metres in rest space, as the chest carries it.
        radius: Of the limb, metres.
    """
    lower, upper, extents = _trunk(person)
    nearest = np.clip(points[..., 1], lower[1], upper[1])[..., None]
    axis = lower + (upper - lower) * (nearest - lower[1]) / (upper[1] - lower[1])
    return _outside(points - axis, extents + radius)


def way_out_of_head(person: Person, points: Array, radius: float) -> Array:
    """The same for the head; points in rest space, as the head carries it."""
    middle = person.place("head") + person.height * HEAD
    extents = person.height * np.array(person.thickness.head)
    return _outside(points - middle, extents + radius)
