"""A skeleton that moves a mesh by linear blend skinning."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Skeleton:
    """J joints of a person at rest, and the skinning weights of the mesh.

    A rotation turns everything below a joint about that joint, in the axes of canonical head space,
    in which the rest pose is given.

    Attributes:
        names: Names of the joints in MakeHuman's default rig.
        parents: (J,) int index of each joint's parent, -1 for the root; parents come before
            children.
        at: (J, 3) float64 positions of the joints at rest, metres, canonical head space.
        weights: (V, J) float32 share of each joint in each vertex; rows sum to 1.
    """

    names: tuple[str, ...]
    parents: np.ndarray
    at: np.ndarray
    weights: np.ndarray

    def index(self, name: str) -> int:
        """Index of a joint; ValueError if no joint has this name."""
        return self.names.index(name)

    def of(self, vertices: np.ndarray) -> "Skeleton":
        """The skeleton of a mesh whose vertices are these (N,) indices into the present one."""
        return replace(self, weights=self.weights[vertices])

    def matrices(self, rotations: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Transforms of all joints from the rest pose.

        Args:
            rotations: (F, J, 3, 3) rotation of each joint about itself.
            shift: (F, 3) displacement of the root, metres.

        Returns:
            (F, J, 4, 4) float64 transforms from rest to pose.
        """
        local = np.tile(np.eye(4), (*rotations.shape[:2], 1, 1))  # (F, J, 4, 4)
        local[..., :3, :3] = rotations
        local[..., :3, 3] = self.at - np.einsum("fjab,jb->fja", rotations, self.at)
        local[:, 0, :3, 3] += shift
        world = local.copy()
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                world[:, joint] = world[:, parent] @ local[:, joint]
        return world

    def mixed(self, matrices: np.ndarray) -> np.ndarray:
        """What moves each vertex, (V, 3, 4), for joint transforms (J, 4, 4); of their precision."""
        rows = matrices[:, :3].reshape(len(matrices), 12)
        return (self.weights @ rows).reshape(-1, 3, 4)

    def skinned(self, vertices: np.ndarray, matrices: np.ndarray) -> np.ndarray:
        """Vertices (V, 3) float32, moved by joint transforms (J, 4, 4)."""
        mixed = self.mixed(matrices.astype(np.float32))
        return np.einsum("vab,vb->va", mixed[..., :3], vertices) + mixed[..., 3]


def about(axis: np.ndarray, angles: ArrayLike) -> np.ndarray:
    """Rotations about axes (Rodrigues' formula).

    Args:
        axis: (..., 3) unit vectors, broadcast against the angles.
        angles: (...,) radians.

    Returns:
        (..., 3, 3) rotation matrices.
    """
    axis, angles = np.asarray(axis, float), np.asarray(angles, float)
    x, y, z = np.moveaxis(axis, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack(
        [np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], -2
    )  # (..., 3, 3)
    sine, cosine = np.sin(angles)[..., None, None], np.cos(angles)[..., None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)


def turned(turns: np.ndarray) -> np.ndarray:
    """Rotations (F, 3, 3) of angles (F, 3) about X, Y, Z in radians, applied in order Z, X, Y."""
    x, y, z = (about(np.eye(3)[i], turns[:, i]) for i in range(3))
    return y @ x @ z
