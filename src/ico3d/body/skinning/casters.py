"""What casts a body's shadow: spheres just under the template's skin."""

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from ico3d.body.skinning.template import Skin, sampled
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.shadow_map import RADIUS

SPARE = 6.0
"""Times as many points as spheres of the same area are drawn: those near to others are left out."""


def spread_casters(track: BodyTrack) -> Skin:
    """Centres of spheres of `RADIUS` that touch the template's skin from within, and cover it."""
    corners = track.vertices[track.faces].astype(np.float64)  # (T, 3, 3)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # (T, 3)
    area = np.linalg.norm(across, axis=1).sum() / 2
    rng = np.random.default_rng(0)
    skin = sampled(track, int(np.ceil(SPARE * area / (np.pi * RADIUS**2))), rng)
    skin = skin[_apart(skin.points)]
    return Skin(skin.points - RADIUS * skin.normals, skin.normals, skin.binding)


def caster_tensors(casters: Skin) -> dict[str, Tensor]:
    """Spheres as `Skinned.shared` names them."""
    binding = casters.binding
    return {
        "caster_points": torch.from_numpy(casters.points).float(),
        "caster_joints": torch.from_numpy(binding.joints.astype(np.int32)),
        "caster_weights": torch.from_numpy(binding.weights).float(),
    }


def _apart(points: np.ndarray) -> np.ndarray:
    """Numbers of points (P, 3) that have `RADIUS` between them, while all others are nearer."""
    tree, left = KDTree(points), np.ones(len(points), bool)
    chosen = []
    for number in range(len(points)):
        if left[number]:
            chosen.append(number)
            left[tree.query_ball_point(points[number], RADIUS)] = False
    return np.array(chosen)
