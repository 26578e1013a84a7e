"""Which joints carry a vertex: linear blend skinning with four joints each."""

from dataclasses import dataclass

import numpy as np

from ico3d.rig.quaternions import Array

INFLUENCES = 4


@dataclass(frozen=True, eq=False)
class Binding:
    """V vertices that hang on at most four joints each.

    Attributes:
        joints: (V, 4) uint8 numbers of joints.
        weights: (V, 4) float32 ≥ 0; rows sum to 1.
    """

    joints: np.ndarray
    weights: np.ndarray

    @staticmethod
    def strongest(dense: Array) -> "Binding":
        """The four strongest of dense weights (V, J), made to sum to 1."""
        count = min(INFLUENCES, dense.shape[1])
        order = np.argsort(-dense, axis=1, kind="stable")[:, :count]  # (V, ≤4)
        joints = np.zeros((len(dense), INFLUENCES), np.uint8)
        weights = np.zeros((len(dense), INFLUENCES), np.float32)
        joints[:, :count] = order
        weights[:, :count] = np.take_along_axis(dense, order, 1)
        return Binding(joints, weights / np.maximum(weights.sum(1, keepdims=True), 1e-12))

    def dense(self, joints: int) -> Array:
        """(V, joints) float32, zero where a joint does not carry a vertex."""
        found = np.zeros((len(self.joints), joints), np.float32)
        np.add.at(found, (np.arange(len(found))[:, None], self.joints), self.weights)
        return found

    def skinned(self, vertices: Array, matrices: Array) -> Array:
        """Vertices that follow their joints.

        Args:
            vertices: (V, 3) metres at rest.
            matrices: (J, 4, 4) from rest to the world (`Rig.matrices`).

        Returns:
            (V, 3) metres in the world.
        """
        rows = matrices[:, :3].astype(np.float32)  # (J, 3, 4)
        mixed = np.einsum("vk,vkab->vab", self.weights, rows[self.joints])  # (V, 3, 4)
        return np.einsum("vab,vb->va", mixed[..., :3], vertices) + mixed[..., 3]
