"""Points on the template's surface at rest, bound to the skeleton."""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack

LEAST_WEIGHT = 1e-3
"""Least weight of a joint, so that its logarithm is finite."""


@dataclass(frozen=True, eq=False)
class Skin:
    """P points of a person's surface at rest, bound to joints.

    Attributes:
        points: (P, 3) positions in rest space, metres.
        normals: (P, 3) outward normals of the surface, of length 1.
        binding: Joints that carry each point, with weights.
    """

    points: np.ndarray
    normals: np.ndarray
    binding: Binding

    def __len__(self) -> int:
        """Number P of points."""
        return len(self.points)

    def __getitem__(self, index: np.ndarray) -> "Skin":
        """The points that a mask (P,) or an array of indices selects."""
        binding = Binding(self.binding.joints[index], self.binding.weights[index])
        return Skin(self.points[index], self.normals[index], binding)

    @staticmethod
    def joined(*parts: "Skin") -> "Skin":
        """The points of several skins, one after the other."""
        return Skin(
            np.concatenate([part.points for part in parts]),
            np.concatenate([part.normals for part in parts]),
            Binding(
                np.concatenate([part.binding.joints for part in parts]),
                np.concatenate([part.binding.weights for part in parts]),
            ),
        )

    def posed(self, track: BodyTrack, frame: int) -> np.ndarray:
        """(P, 3) positions of the points in the world at a frame of a track, metres."""
        matrices = track.rig.matrices(track.rotations[frame], track.roots[frame])
        return self.binding.skinned(self.points, matrices)

    def pulled_back(self, places: np.ndarray, track: BodyTrack, frame: int) -> "Skin":
        """Positions in the world at a frame, as points at rest.

        Each position takes binding and normal of the point of this skin that is nearest to it at
        that frame.

        Args:
            places: (Q, 3) positions in the world, metres.
            track: How the person moves.
            frame: Frame at which the positions were seen.

        Returns:
            Q points at rest.
        """
        near = self[np.asarray(KDTree(self.posed(track, frame)).query(places)[1])]
        matrices = track.rig.matrices(track.rotations[frame], track.roots[frame])  # (J, 4, 4)
        weights, hung = near.binding.weights, matrices[near.binding.joints]
        mixed = np.einsum("qk,qkab->qab", weights, hung)  # (Q, 4, 4)
        world = np.concatenate([places, np.ones((len(places), 1))], 1)  # (Q, 4)
        rest = np.linalg.solve(mixed, world[:, :, None])[:, :3, 0]  # (Q, 3)
        return Skin(rest, near.normals, near.binding)


def sampled(track: BodyTrack, count: int, rng: np.random.Generator) -> Skin:
    """Random points, spread evenly over the template's surface at rest.

    Args:
        track: The body track, whose template is sampled.
        count: Number of points.
        rng: Draws the points.
    """
    corners = track.vertices[track.faces].astype(np.float64)  # (T, 3, 3)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # (T, 3)
    areas = np.linalg.norm(across, axis=1)  # (T,)
    chosen = rng.choice(len(areas), count, p=areas / areas.sum())  # (P,)
    parts = rng.dirichlet(np.ones(3), count)  # (P, 3)
    points = np.einsum("pc,pcd->pd", parts, corners[chosen])  # (P, 3)
    normals = across[chosen] / np.maximum(areas[chosen, None], 1e-12)  # (P, 3)
    dense = track.binding.dense(len(track.rig))[track.faces[chosen]]  # (P, 3, J)
    binding = Binding.strongest(np.einsum("pc,pcj->pj", parts, dense))
    return Skin(points, normals, binding)


def hung_logits(binding: Binding) -> Tensor:
    """(P, 4) logarithms of a binding's weights, whose softmax gives these weights."""
    return torch.from_numpy(binding.weights).float().clamp_min(LEAST_WEIGHT).log()
