"""The template with a shape and poses, and derivatives of its points by these parameters."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ico3d.capture.posing.model.anatomy import Anatomy
from ico3d.capture.posing.model.template import Template
from ico3d.rig.quaternions import from_rotvec, to_matrix


@dataclass(eq=False)
class Body:
    """The parameters of a fit, for F frames.

    Attributes:
        shape: (K,) shape coefficients of the template.
        offsets: (P, 3) offsets of the person's landmarks from the template's, at rest, metres.
        off_skin: (M,) distance by which clothes and hair stand off the template at M nodes, metres.
        angles: (F, J, 3) rotation vectors of the joints along their axes of bend, side and twist
            (`Anatomy.axes`), radians.
        root_turns: (F, 3, 3) rotations that are applied after the root's own; they are not fitted.
        roots: (F, 3) translations of the root from rest, metres.
    """

    shape: np.ndarray
    offsets: np.ndarray
    off_skin: np.ndarray
    angles: np.ndarray
    root_turns: np.ndarray
    roots: np.ndarray

    @staticmethod
    def at_rest(
        template: Template, off_skin: np.ndarray, root_turns: np.ndarray, roots: np.ndarray
    ) -> "Body":
        """The mean shape in the rest pose, with given positions of F frames.

        Args:
            template: The template.
            off_skin: (M,) distance off the template at nodes, metres.
            root_turns: (F, 3, 3) rotations of the root.
            roots: (F, 3) translations of the root, metres.
        """
        joints, marks = len(template.names), len(template.landmarks)
        return Body(
            np.zeros(template.num_shapes),
            np.zeros((marks, 3)),
            off_skin.copy(),
            np.zeros((len(roots), joints, 3)),
            root_turns,
            roots.copy(),
        )


@dataclass(frozen=True, eq=False)
class Posed:
    """The joints of a body in one frame.

    Attributes:
        turns: (J, 3, 3) rotations from rest space to the world.
        places: (J, 3) positions in the world, metres.
        axes: (J, 3, 3) derivatives of each joint's rotation: column i is the rotation vector in
            the world, per radian of the joint's angle i, of all that the joint carries.
        joints: (J, 3) positions at rest, metres.
    """

    turns: np.ndarray
    places: np.ndarray
    axes: np.ndarray
    joints: np.ndarray

    @cached_property
    def screws(self) -> np.ndarray:
        """(6, 3 J) of each angle: its axis, and the velocity of the world's origin about it."""
        moves = np.cross(self.places[:, None], self.axes.swapaxes(-1, -2))  # (J, 3, 3) rows
        turned = self.axes.swapaxes(-1, -2)  # (J, 3, 3) rows
        return np.concatenate([turned, moves], -1).reshape(-1, 6).T

    def changes(self, points: np.ndarray, ways: np.ndarray, carried: np.ndarray) -> np.ndarray:
        """Derivatives of points along given directions by all angles and the root's translation.

        Args:
            points: (N, 3) positions in the world, metres.
            ways: (N, 3) direction for each point.
            carried: (N, J) share of each point that is carried by each joint or a joint below it.

        Returns:
            (N, 3 J + 3).
        """
        twists = np.concatenate([np.cross(points, ways), ways], 1)  # (N, 6)
        turning = (twists @ self.screws).reshape(*carried.shape, 3)  # (N, J, 3)
        turning = turning * carried[..., None]
        return np.concatenate([turning.reshape(len(points), self.screws.shape[1]), ways], 1)


class Kinematics:
    """Forward kinematics of the template.

    Attributes:
        template: The template.
        anatomy: Axes and ranges of its joints.
        below: (J, J) bool: whether the joint of the row is that of the column, or below it.
    """

    def __init__(self, template: Template, anatomy: Anatomy):
        """Prepares the tree of joints."""
        self.template, self.anatomy = template, anatomy
        below = np.eye(len(template.parents), dtype=bool)  # (J, J): column carries row
        for joint, parent in enumerate(template.parents[1:], 1):
            below[joint] |= below[parent]
        self.below = below

    def posed(self, body: Body, frame: int) -> Posed:
        """The joints of a body in frame number `frame` of the fit."""
        vectors = np.einsum("jab,jb->ja", self.anatomy.axes, body.angles[frame])
        turns = to_matrix(from_rotvec(vectors))  # (J, 3, 3)
        turns[0] = body.root_turns[frame] @ turns[0]
        joints = mixed(self.template.joints, body.shape)
        places = np.empty_like(joints)
        places[0] = joints[0] + body.roots[frame]
        for joint, parent in enumerate(self.template.parents[1:], 1):
            turns[joint] = turns[parent] @ turns[joint]
            places[joint] = places[parent] + turns[parent] @ (joints[joint] - joints[parent])
        return Posed(turns, places, turns @ _right_jacobian(vectors) @ self.anatomy.axes, joints)

    def reshaped(self, posed: Posed) -> np.ndarray:
        """(K, J, 3) derivatives of the joints' positions in the world by shape coefficients."""
        basis = self.template.joints[1:]  # (K, J, 3)
        places = basis.copy()
        for joint, parent in enumerate(self.template.parents[1:], 1):
            bones = basis[:, joint] - basis[:, parent]  # (K, 3)
            places[:, joint] = places[:, parent] + bones @ posed.turns[parent].T
        return places


def mixed(table: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """(N, 3) points of a shape: table[0] + Σ_k shape_k · table[1 + k].

    Args:
        table: (1 + K, N, 3) mean and basis.
        shape: (K,) coefficients.
    """
    return table[0] + np.tensordot(shape, table[1:], 1)


def _right_jacobian(vectors: np.ndarray) -> np.ndarray:
    """(..., 3, 3) right Jacobians of SO(3) at rotation vectors (..., 3).

    They map a change of the rotation vector to the rotation's change, in its own rotated axes.
    """
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1)
    cross = cross.reshape(*vectors.shape, 3)  # (..., 3, 3)
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)
    second = np.where(small, 1 / 6, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) - first * cross + second * (cross @ cross)
