"""Rigs: the joints of a skeleton as a tree, and forward kinematics."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ico3d.rig.quaternions import Array, multiply, rotate, to_matrix

MOST_JOINTS = 256
"""Most joints of a rig, so that one byte holds the index of a joint."""
REACH = 10.0
"""Largest coordinate of a joint at rest, metres."""


@dataclass(frozen=True, eq=False)
class Rig:
    """A skeleton of J joints at rest.

    Rest space is in metres, with +y up; the person faces +z, and +x is the person's left. In the
    rest pose all rotations are the identity. The local rotation of a joint is about the joint, in
    the axes of rest space, and moves all joints below it in the tree.

    Attributes:
        names: Unique names of the joints.
        parents: Index of each joint's parent, which is smaller than the joint's own; −1 for joint
            0, the only root.
        joints: (J, 3) float64 positions of the joints at rest.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    joints: Array

    def __post_init__(self):
        """Checks names, positions, and that the joints are a tree.

        Raises:
            ValueError: If they do not make a rig.
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
        """Number J of joints."""
        return len(self.names)

    def index(self, name: str) -> int:
        """Index of a joint.

        Raises:
            ValueError: If no joint has this name.
        """
        return self.names.index(name)

    def posed(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """Rotations and positions of the joints in a pose.

        Args:
            rotations: (..., J, 4) local rotation of each joint, wxyz.
            root: (..., 3) translation of the root from rest, metres.

        Returns:
            Rotations (..., J, 4) wxyz from rest space to the world, and positions (..., J, 3) of
            the joints in the world. A point x bound to joint j moves to
            R_j (x − joints_j) + position_j.
        """
        turned = np.array(rotations, np.float64)  # (..., J, 4)
        places = np.broadcast_to(self.joints, (*turned.shape[:-1], 3)).copy()  # (..., J, 3)
        places[..., 0, :] += root
        for joints, parents in self._levels:
            above = turned[..., parents, :]  # (..., L, 4)
            turned[..., joints, :] = multiply(above, turned[..., joints, :])
            bones = self.joints[joints] - self.joints[parents]  # (L, 3)
            places[..., joints, :] = places[..., parents, :] + rotate(above, bones)
        return turned, places

    @cached_property
    def _levels(self) -> list[tuple[list[int], list[int]]]:
        """Joints and their parents, by how many joints lie between them and the root."""
        return levels(self.parents)

    def matrices(self, rotations: Array, root: Array) -> Array:
        """(..., J, 4, 4) rigid transforms of points bound to each joint, from rest to the world.

        Args:
            rotations: (..., J, 4) local rotation of each joint, wxyz.
            root: (..., 3) translation of the root from rest, metres.
        """
        turned, places = self.posed(rotations, root)
        found = np.zeros((*places.shape[:-1], 4, 4))  # (..., J, 4, 4)
        found[..., :3, :3] = to_matrix(turned)
        moved = np.einsum("...ab,...b->...a", found[..., :3, :3], self.joints)
        found[..., :3, 3] = places - moved
        found[..., 3, 3] = 1
        return found

    def rest(self, *shape: int) -> Array:
        """(*shape, J, 4) local rotations of the rest pose, which are identities."""
        found = np.zeros((*shape, len(self), 4))  # (..., J, 4)
        found[..., 0] = 1
        return found


def levels(parents: Sequence[int]) -> list[tuple[list[int], list[int]]]:
    """What hangs on something in a forest, such that each level hangs on those before it.

    Args:
        parents: Of each its parent, which comes before it; −1 for roots.

    Returns:
        For each level its members and their parents.
    """
    depth: list[int] = []
    found: list[tuple[list[int], list[int]]] = []
    for member, parent in enumerate(parents):
        depth.append(depth[parent] + 1 if parent >= 0 else 0)
        if parent < 0:
            continue
        if depth[member] > len(found):
            found.append(([], []))
        members, above = found[depth[member] - 1]
        members.append(member)
        above.append(parent)
    return found
