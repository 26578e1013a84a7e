"""Moves poses from rest space, where a person faces +z, to where the person was recorded."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.living import Living
from ico3d.motion.roles import SIDES
from ico3d.motion.turning import about, twist_angle
from ico3d.rig.quaternions import Array, multiply, rotate

UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Footing:
    """The rigid motion from rest space to where a person was recorded.

    Attributes:
        turn: (4,) rotation about the vertical, wxyz.
        origin: (3,) position of rest space's origin in the world, metres.
        pivot: (3,) position of joint 0 at rest, metres.
    """

    turn: Array
    origin: Array
    pivot: Array

    def place(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """Moves poses from rest space to the world.

        Args:
            rotations: (..., J, 4) local rotation of each joint, wxyz.
            root: (..., 3) translation of the root in rest space, metres.

        Returns:
            (..., J, 4) and (..., 3): the same poses, with the root's rotation and translation in
            the world.
        """
        turned = np.array(rotations, np.float64)  # (..., J, 4)
        turned[..., 0, :] = multiply(self.turn, turned[..., 0, :])
        return turned, rotate(self.turn, self.pivot + root) + self.origin - self.pivot


def footing(living: Living, rotations: Array, root: Array) -> Footing:
    """Footing that keeps the feet, and the direction of the hips, of a recorded pose.

    Args:
        living: How the person stands in rest space.
        rotations: (J, 4) local rotations of the recorded pose, wxyz.
        root: (3,) translation of the root in the recorded pose, metres.
    """
    person = living.person
    joints = person.cast.joints
    turned, places = person.rig.posed(rotations, root)
    stood = np.mean([places[joints[f"{side}_ankle"][-1]] for side in SIDES], axis=0)  # (3,)
    stands = np.mean([living.stance.ankles[side] for side in SIDES], axis=0)  # (3,)
    turn = about(UP, twist_angle(turned[joints["hips"][-1]], UP))
    return Footing(turn, stood - rotate(turn, stands), person.rig.joints[0])
