"""Binds vertices to joints: linear blend skinning with up to four joints per vertex."""

from dataclasses import dataclass

import numpy as np

from ico3d.rig.quaternions import Array

INFLUENCES = 4
"""Most joints that carry a vertex."""


@dataclass(frozen=True, eq=False)
class Binding:
    """Joints that carry V vertices, at most four each, with weights.

    Attributes:
        joints: (V, 4) uint8 indices of joints.
        weights: (V, 4) float32 weights of these joints, not negative; rows sum to 1.
    """

    joints: np.ndarray
    weights: np.ndarray

    @staticmethod
    def strongest(dense: Array) -> "Binding":
        """A binding of the four largest of dense weights (V, J) per vertex, scaled to sum 1."""
        count = min(INFLUENCES, dense.shape[1])
        order = np.argsort(-dense, axis=1, kind="stable")[:, :count]  # (V, ≤4)
        joints = np.zeros((len(dense), INFLUENCES), np.uint8)
        weights = np.zeros((len(dense), INFLUENCES), np.float32)
        joints[:, :count] = order
        weights[:, :count] = np.take_along_axis(dense, order, 1)
        return Binding(joints, weights / np.maximum(weights.sum(1, keepdims=True), 1e-12))

    def dense(self, joints: int) -> Array:
        """(V, joints) float32 weights of all joints; 0 where a joint does not carry a vertex."""
        found = np.zeros((len(self.joints), joints), np.float32)
        np.add.at(found, (np.arange(len(found))[:, None], self.joints), self.weights)
        return found

    def skinned(self, vertices: Array, matrices: Array) -> Array:
        """Moves vertices with their joints.

        Args:
            vertices: (V, 3) positions at rest, metres.
            matrices: (J, 4, 4) transforms of the joints from rest to the world (`Rig.matrices`).

        Returns:
            (V, 3) metres in the world.
        """
        rows = matrices[:, :3].astype(np.float32)  # (J, 3, 4)
        mixed = np.einsum("vk,vkab->vab", self.weights, rows[self.joints])  # (V, 3, 4)
        return np.einsum("vab,vb->va", mixed[..., :3], vertices) + mixed[..., 3]
