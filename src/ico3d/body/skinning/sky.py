"""How much of the light from all around reaches a body, which hides parts of it from itself."""

from collections.abc import Mapping

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor
from torch.nn.functional import embedding_bag, normalize

from ico3d.body.skinning.shadow import reached
from ico3d.common.spread import directions
from ico3d.rig.shadow_map import RADIUS, SKY_LEAST

NEAR = 24
"""Spheres by a place that are looked at, the nearest ones."""
WIDTH = 0.02
"""Metres over which spheres count for a place."""
SIDEWAYS = 0.02
"""Cosine between the directions of a place and a sphere, below which all count alike."""
CARRIERS = 4
"""Spheres from which a Gaussian takes what it sees."""


def seen_sky(casters: Tensor, normals: Tensor, count: int) -> Tensor:
    """The share of the light from all around that reaches the skin above each sphere.

    Depth maps from directions all around tell what is hidden, as a lamp's does; a direction counts
    by its cosine. Nothing learns by it.

    Args:
        casters: (M, 3) centres of the spheres, metres in the world.
        normals: (M, 3) out of the body.
        count: Number of directions.

    Returns:
        (M,) from `SKY_LEAST` to 1.
    """
    facing = normalize(normals, dim=1)
    skin = casters + RADIUS * facing  # (M, 3)
    seen, possible = torch.zeros_like(skin[:, 0]), torch.zeros_like(skin[:, 0])  # (M,) each
    for direction in torch.from_numpy(directions(count)).to(casters):
        cosine = (facing @ direction).clamp_min(0)  # (M,)
        seen += cosine * reached(skin, facing, casters, direction)
        possible += cosine
    return (seen / possible.clamp_min(1e-6)).clamp_min(SKY_LEAST)


def turned(table: Tensor, normals: Tensor, joints: Tensor, weights: Tensor) -> Tensor:
    """(M, 3) directions out of the posed body above the spheres, of any length.

    Args:
        table: (J, 16) of `ico3d.body.skinning.kinematics.transforms`.
        normals: (M, 3) at rest.
        joints: (M, 4) int32, which joints carry a sphere.
        weights: (M, 4).
    """
    mixed = embedding_bag(joints, table[:, :9], mode="sum", per_sample_weights=weights)  # (M, 9)
    return (mixed.unflatten(1, (3, 3)) * normals[:, None]).sum(2)


def sky_carriers(
    points: np.ndarray, normals: np.ndarray, casters: Mapping[str, Tensor]
) -> dict[str, Tensor]:
    """The spheres whose sky is that of points: near ones on skin that faces alike.

    Args:
        points: (N, 3) metres at rest.
        normals: (N, 3) unit vectors.
        casters: Of `ico3d.body.skinning.casters.caster_tensors`.

    Returns:
        `sky_casters` (N, 4) int32, indices of spheres, and `sky_weights` (N, 4), with the sum 1.
    """
    facing = casters["caster_normals"].cpu().double().numpy()  # (M, 3)
    skin = casters["caster_points"].cpu().double().numpy() + RADIUS * facing
    count = min(NEAR, len(skin))
    away, near = KDTree(skin).query(points, k=np.arange(1, count + 1))  # (N, C)
    cosine = np.einsum("nd,ncd->nc", normals, facing[near])
    score = 2 * np.log(np.maximum(cosine, SIDEWAYS)) - np.square(away / WIDTH) / 2  # (N, C)
    best = np.argsort(-score, axis=1, kind="stable")[:, np.arange(CARRIERS) % count]  # (N, 4)
    score = np.take_along_axis(score, best, 1)
    weights = np.exp(score - score[:, :1])
    weights /= weights.sum(1, keepdims=True)
    chosen = np.take_along_axis(near, best, 1).astype(np.int32)
    return {
        "sky_casters": torch.from_numpy(chosen),
        "sky_weights": torch.from_numpy(weights).float(),
    }


def carried(seen: Tensor, casters: Tensor, weights: Tensor) -> Tensor:
    """(N,) what Gaussians see of the sky, from what is seen (M,) above their spheres (N, 4)."""
    return (seen[casters.long()] * weights).sum(1)
