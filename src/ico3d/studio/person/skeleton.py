"""Bones under a mesh: linear blend skinning."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Skeleton:
    """J joints of a person at rest, and which vertices hang on them.

    Rotations are given about the joint, in the axes of canonical head space, in which the rest
    pose stands; a joint carries all that lies below it.

    Attributes:
        names: J names, MakeHuman's default rig.
        parents: (J,) int, parents before children, -1 for the root.
        at: (J, 3) float64 joints at rest, canonical head space.
        weights: (V, J) float32 part of each joint in each vertex; rows sum to 1.
    """

    names: tuple[str, ...]
    parents: np.ndarray
    at: np.ndarray
    weights: np.ndarray

    def index(self, name: str) -> int:
        """Number of a joint; ValueError if there is none of that name."""
        return self.names.index(name)

    def matrices(self, rotations: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Where each joint takes what is bound to it.

        Args:
            rotations: (F, J, 3, 3) of each joint about itself.
            shift: (F, 3) metres that the root moves.

        Returns:
            (F, J, 4, 4) float64: posed from rest.
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

    def skinned(self, vertices: np.ndarray, matrices: np.ndarray) -> np.ndarray:
        """Vertices (V, 3) float32 that follow joints (J, 4, 4)."""
        rows = matrices[:, :3].reshape(len(matrices), 12).astype(np.float32)
        mixed = (self.weights @ rows).reshape(-1, 3, 4)  # (V, 3, 4)
        return np.einsum("vab,vb->va", mixed[..., :3], vertices) + mixed[..., 3]


def about(axis: np.ndarray, angles: ArrayLike) -> np.ndarray:
    """Rotations about axes (Rodrigues' formula).

    Args:
        axis: (..., 3) unit vectors.
        angles: (...,) radians; both are broadcast.

    Returns:
        (..., 3, 3).
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
    """(F, 3, 3) rotations from (F, 3) radians about X, Y, Z: first about Z, then X, then Y."""
    x, y, z = (about(np.eye(3)[i], turns[:, i]) for i in range(3))
    return y @ x @ z
