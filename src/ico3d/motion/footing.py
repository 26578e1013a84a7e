"""Where somebody stands in the world, who in rest space stands at its origin and faces +z."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.living import Living
from ico3d.motion.roles import SIDES
from ico3d.motion.turning import about, twist_angle
from ico3d.rig.quaternions import Array, multiply, rotate

UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Footing:
    """Takes poses of rest space to where somebody was recorded.

    Attributes:
        turn: (4,) wxyz about the vertical.
        origin: (3,) metres in the world, of rest space.
        pivot: (3,) metres, joint 0 at rest.
    """

    turn: Array
    origin: Array
    pivot: Array

    def place(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """Poses in the world.

        Args:
            rotations: (..., J, 4) wxyz of each joint about itself, in rest space.
            root: (..., 3) metres that the root moves there.
        """
        turned = np.array(rotations, np.float64)  # (..., J, 4)
        turned[..., 0, :] = multiply(self.turn, turned[..., 0, :])
        return turned, rotate(self.turn, self.pivot + root) + self.origin - self.pivot


def footing(living: Living, rotations: Array, root: Array) -> Footing:
    """Feet where they are in a recorded pose, the person turned as the hips are about the vertical.

    Args:
        living: How somebody stands in rest space.
        rotations: (J, 4) wxyz of each joint about itself, recorded.
        root: (3,) metres that the root moves.
    """
    person = living.person
    joints = person.cast.joints
    turned, places = person.rig.posed(rotations, root)
    stood = np.mean([places[joints[f"{side}_ankle"][-1]] for side in SIDES], axis=0)  # (3,)
    stands = np.mean([living.stance.ankles[side] for side in SIDES], axis=0)  # (3,)
    turn = about(UP, twist_angle(turned[joints["hips"][-1]], UP))
    return Footing(turn, stood - rotate(turn, stands), person.rig.joints[0])
