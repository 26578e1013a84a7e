"""Bones: which joint hangs on which, and where they take what is bound to them."""

from dataclasses import dataclass

import numpy as np

from ico3d.rig.quaternions import Array, multiply, rotate, to_matrix

MOST_JOINTS = 256
"""What one byte can number."""
REACH = 10.0
"""Metres; no joint of a person at rest lies farther from the origin."""


@dataclass(frozen=True, eq=False)
class Rig:
    """J joints of a person at rest.

    In the rest pose no joint is turned: rotations are given about the joint in the axes of rest
    space (metres, +y up, the person faces +z, +x is the person's left) and carry all that hangs
    on the joint.

    Attributes:
        names: J names, each once.
        parents: J numbers, each smaller than its own; −1 for joint 0, the only root.
        joints: (J, 3) float64 at rest.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    joints: Array

    def __post_init__(self):
        """Checks that it is a tree.

        Raises:
            ValueError: In one sentence, if it is none.
        """
        count = len(self.names)
        if not 1 <= count <= MOST_JOINTS or len(set(self.names)) != count:
            raise ValueError(f"a rig has 1 to {MOST_JOINTS} joints of different names")
        if len(self.parents) != count or self.joints.shape != (count, 3):
            raise ValueError("a rig's names, parents and joints differ in number")
        if self.parents[0] != -1:
            raise ValueError("joint 0 of a rig is its root")
        for joint, parent in enumerate(self.parents[1:], 1):
            if not 0 <= parent < joint:
                raise ValueError(f"parents of a rig come before children; joint {joint} does not")
        if not (np.abs(self.joints) <= REACH).all():  # also where one is NaN
            raise ValueError(f"a joint of the rig lies more than {REACH:g} m from the origin")

    def __len__(self) -> int:
        """J."""
        return len(self.names)

    def index(self, name: str) -> int:
        """Number of a joint; ValueError if there is none of that name."""
        return self.names.index(name)

    def posed(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """Where each joint is and how it is turned.

        Args:
            rotations: (..., J, 4) wxyz of each joint about itself.
            root: (..., 3) metres that the root moves.

        Returns:
            Rotations (..., J, 4) wxyz from rest space to the world, and places (..., J, 3) of the
            joints in the world. A point x bound to joint j goes to R_j (x − joints_j) + place_j.
        """
        turned = np.array(rotations, np.float64)  # (..., J, 4)
        places = np.broadcast_to(self.joints, (*turned.shape[:-1], 3)).copy()  # (..., J, 3)
        places[..., 0, :] += root
        for joint, parent in enumerate(self.parents[1:], 1):
            turned[..., joint, :] = multiply(turned[..., parent, :], turned[..., joint, :])
            bone = self.joints[joint] - self.joints[parent]  # (3,)
            places[..., joint, :] = places[..., parent, :] + rotate(turned[..., parent, :], bone)
        return turned, places

    def matrices(self, rotations: Array, root: Array) -> Array:
        """(..., J, 4, 4) that take what is bound to each joint from rest to the world."""
        turned, places = self.posed(rotations, root)
        found = np.zeros((*places.shape[:-1], 4, 4))  # (..., J, 4, 4)
        found[..., :3, :3] = to_matrix(turned)
        moved = np.einsum("...ab,...b->...a", found[..., :3, :3], self.joints)
        found[..., :3, 3] = places - moved
        found[..., 3, 3] = 1
        return found

    def rest(self, *shape: int) -> Array:
        """(*shape, J, 4) rotations of the rest pose."""
        found = np.zeros((*shape, len(self), 4))  # (..., J, 4)
        found[..., 0] = 1
        return found
