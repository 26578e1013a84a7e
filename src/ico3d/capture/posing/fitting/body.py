"""The template in a shape and in poses, and how it moves when one of its numbers changes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ico3d.capture.posing.model.anatomy import Anatomy
from ico3d.capture.posing.model.template import Template
from ico3d.rig.quaternions import from_rotvec, to_matrix


@dataclass(eq=False)
class Body:
    """What a fit seeks, for F frames.

    Attributes:
        shape: (K,) coefficients of the template.
        offsets: (P, 3) metres by which landmarks are elsewhere than on the template, at rest.
        off_skin: (M,) metres by which clothes and hair stand off the template, at nodes.
        angles: (F, J, 3) radians of the joints about bend, side and twist.
        root_turns: (F, 3, 3) that come after the root's own angles; they stay.
        roots: (F, 3) metres that the root moves.
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
        """The mean shape at rest, turned and placed."""
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
    """A body in one frame.

    Attributes:
        turns: (J, 3, 3) from rest space to the world.
        places: (J, 3) joints in the world.
        axes: (J, 3, 3) columns: the world's axes about which what a joint carries turns, by radian
            of its angles.
        joints: (J, 3) at rest.
    """

    turns: np.ndarray
    places: np.ndarray
    axes: np.ndarray
    joints: np.ndarray

    @cached_property
    def screws(self) -> np.ndarray:
        """(6, 3 J) of each angle: its axis, and how the world's origin would move about it."""
        moves = np.cross(self.places[:, None], self.axes.swapaxes(-1, -2))  # (J, 3, 3) rows
        turned = self.axes.swapaxes(-1, -2)  # (J, 3, 3) rows
        return np.concatenate([turned, moves], -1).reshape(-1, 6).T

    def changes(self, points: np.ndarray, ways: np.ndarray, carried: np.ndarray) -> np.ndarray:
        """How far points go along given ways, by angle and by move of the root.

        Args:
            points: (N, 3) in the world.
            ways: (N, 3).
            carried: (N, J) part of each point that hangs on each joint or below it.

        Returns:
            (N, 3 J + 3).
        """
        twists = np.concatenate([np.cross(points, ways), ways], 1)  # (N, 6)
        turning = (twists @ self.screws).reshape(*carried.shape, 3)  # (N, J, 3)
        turning = turning * carried[..., None]
        return np.concatenate([turning.reshape(len(points), self.screws.shape[1]), ways], 1)


class Kinematics:
    """The template's chains of joints."""

    def __init__(self, template: Template, anatomy: Anatomy):
        """Takes over what does not change."""
        self.template, self.anatomy = template, anatomy
        below = np.eye(len(template.parents), dtype=bool)  # (J, J): column carries row
        for joint, parent in enumerate(template.parents[1:], 1):
            below[joint] |= below[parent]
        self.below = below

    def posed(self, body: Body, frame: int) -> Posed:
        """The body in one of its frames."""
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
        """(K, J, 3) metres that the joints move by one of each shape coefficient."""
        basis = self.template.joints[1:]  # (K, J, 3)
        places = basis.copy()
        for joint, parent in enumerate(self.template.parents[1:], 1):
            bones = basis[:, joint] - basis[:, parent]  # (K, 3)
            places[:, joint] = places[:, parent] + bones @ posed.turns[parent].T
        return places


def mixed(table: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """(N, 3) of a shape, from mean and basis (1 + K, N, 3)."""
    return table[0] + np.tensordot(shape, table[1:], 1)


def _right_jacobian(vectors: np.ndarray) -> np.ndarray:
    """(..., 3, 3): how a rotation turns in its own axes when its rotation vector changes."""
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
