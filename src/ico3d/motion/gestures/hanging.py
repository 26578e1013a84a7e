"""Poses hanging arms: as near to the body as its width allows, a little bent."""

import numpy as np
from numpy.typing import NDArray

from ico3d.motion.clearance import way_out_of_trunk
from ico3d.motion.gestures.shapes import fingers, shape
from ico3d.motion.person import Person
from ico3d.motion.retarget import DOWN, HINGE
from ico3d.motion.roles import INDEX, MIRROR, ROLES
from ico3d.motion.turning import about, mirrored
from ico3d.rig.quaternions import IDENTITY, Array, multiply

BACK, INWARD, BEND, PRONATED = np.radians([5.0, 35.0, 17.0, -5.0])
"""Angles in radians of a hanging arm.

They are how far the upper arm hangs back and is turned inwards, how far the elbow bends, and by
how much the forearm is pronated. Turned inwards, a bent elbow lets the forearm hang straight down
where clothes hold the upper arm off the body.
"""
MOST = np.radians(20.0)
"""Largest angle in radians between hanging arms and the vertical, sideways."""
AWAY = 0.004
"""Distance in metres between a hanging hand and the thigh."""
SIDEWARDS, FORWARD = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def hanging(person: Person) -> Array:
    """(R, 4) pose by role with hanging arms and relaxed fingers, else the standard pose."""
    poses = hung_at(np.arange(0.0, MOST, np.radians(0.5)))  # (N, R, 4)
    clear = np.flatnonzero(_clear(person, poses))
    return poses[clear[0] if len(clear) else -1]


def hung_at(lifted: Array) -> Array:
    """(N, R, 4) poses by role with hanging arms that are lifted sideways by (N,) radians."""
    poses = np.tile(IDENTITY, (len(lifted), len(ROLES), 1))  # (N, R, 4)
    upper = multiply(about(FORWARD, lifted), about(SIDEWARDS, BACK))
    poses[:, INDEX["left_shoulder"]] = multiply(upper, about(DOWN, INWARD))
    poses[:, INDEX["left_elbow"]] = multiply(about(HINGE, BEND), about(DOWN, PRONATED))
    fingers(shape("relaxed"), poses)
    return both_sides(poses)


def both_sides(pose: Array) -> Array:
    """(..., R, 4) pose by role whose roles on the right are mirror images of those on the left."""
    seen = mirrored(pose[..., MIRROR, :])
    right = np.array([role.startswith("right_") for role in ROLES])
    return np.where(right[:, None], seen, pose)


def _clear(person: Person, poses: Array) -> NDArray[np.bool_]:
    """(N,) bool: whether the left forearm and hand are outside of the trunk in poses (N, R, 4)."""
    places = person.posed(poses, np.zeros(3))
    elbow, wrist = places["left_elbow"], places["left_wrist"]
    tips = places.get("left_middle2", wrist + 1.3 * person.hand("left") * DOWN)
    part = np.linspace(0, 1, 6)[:, None, None]
    # (12, N, 3)
    points = np.concatenate([elbow + part * (wrist - elbow), wrist + part * (tips - wrist)])
    radius = person.thickness.arm * person.height + AWAY
    inside = np.abs(way_out_of_trunk(person, points, radius)).max((0, 2))  # (N,)
    return inside == 0
