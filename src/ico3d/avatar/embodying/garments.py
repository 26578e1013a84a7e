"""Which Gaussians of a body are its jumper, its trousers and its shoes."""

import numpy as np
from scipy.spatial import KDTree

from ico3d.avatar.embodying.surfaces import Surfaces, features, legs, main_joints
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.motion.roles import SIDES, Cast, arm_roles

GARMENTS = ("jumper", "trousers", "shoes")
NEIGHBOURS = 16
"""Gaussians about one that have a say in what it belongs to, itself among them."""
MOST = 0.75
"""Share of them that decides against a Gaussian's own colour: stitches that shine are no skin."""
SHAFT = 0.2
"""How far up the shank shoes can reach."""
FLOATING = 0.02
"""Share of the Gaussians on feet that may lie below the soles."""
FAINT = 0.1
"""A Gaussian that is less of clothes than this is none of them."""


def garments_of(body: BakedSkinned, cast: Cast, surfaces: Surfaces) -> np.ndarray:
    """Tells garments apart, by joints and colour.

    What hangs on chest and arms is the jumper, on the knees the trousers, and what is below the
    middle of the ankle is shoes. From the spine to the thighs, where the hem is, colour tells the
    jumper from the trousers, and about the ankles trousers from shoes.

    Args:
        body: The body.
        cast: Joints of its rig by role.
        surfaces: What of it is skin and hair.

    Returns:
        (N, 3) in [0, 1], how much each Gaussian is of `GARMENTS`; skin and hair are of none.
    """
    mainly, colors = main_joints(body), features(body.color_logits)
    count = min(NEIGHBOURS, len(mainly))
    near = KDTree(body.means).query(body.means, count)[1].reshape(-1, count)  # (N, ≤16)
    clothes = _clothes(surfaces, np.isin(mainly, cast.joints["spine"]), body, near)
    clothes[surfaces.head | np.isin(mainly, _fingers(cast))] = 0
    sure = (clothes > 0.9) & (body.opacities > 127)
    leg = np.isin(mainly, legs(cast))
    lower, foot = (
        (cast.below(f"left_{role}") | cast.below(f"right_{role}"))[mainly]
        for role in ("knee", "ankle")
    )
    ankle, knee = (np.mean([cast.place(f"{s}_{r}")[1] for s in SIDES]) for r in ("ankle", "knee"))
    height = body.means[:, 1]
    low = foot & (height < ankle)
    soles = np.append(height[sure & foot], ankle)  # a few may float far below
    shoe = foot & (height < (ankle + np.quantile(soles, FLOATING)) / 2)
    shaft = lower & (height < ankle + SHAFT * (knee - ankle))
    trunk = np.isin(mainly, [j for role in ("hips", "spine") for j in cast.joints[role]])
    at_hem = trunk | (leg & ~lower)
    known = (sure & ~leg & ~at_hem, sure & lower & ~foot, sure & low)
    may = np.stack([~leg | at_hem, (leg | at_hem) & ~shoe, shaft], 1)  # (N, 3)
    away = np.square(colors[:, None] - [_median(colors[part]) for part in known]).sum(2)
    away[~may] = np.inf
    votes = np.eye(len(GARMENTS))[away.argmin(1)]  # (N, 3)
    said = (votes * (clothes * body.opacities)[:, None])[near].sum(1) * may + 1e-6 * votes
    return np.eye(len(GARMENTS))[said.argmax(1)] * clothes[:, None]


def _clothes(
    surfaces: Surfaces, spine: np.ndarray, body: BakedSkinned, near: np.ndarray
) -> np.ndarray:
    """(N,) in [0, 1], how much of a Gaussian is clothes, as far as its neighbours agree.

    Args:
        surfaces: What of the body is skin and hair.
        spine: (N,) bool: Gaussians about the waist, where nobody's skin is seen.
        body: The body.
        near: (N, K) indices of the Gaussians about each.
    """
    clothes = np.where(spine, 1 - surfaces.hair, 1 - surfaces.hair - surfaces.skin)
    weight = body.opacities[near] + 1.0  # (N, K)
    said = (clothes[near] * weight).sum(1) / weight.sum(1)  # (N,)
    clothes = np.where(said > MOST, np.maximum(clothes, said), clothes)
    return np.where((clothes < FAINT) | (said < 1 - MOST), 0.0, clothes)


def _fingers(cast: Cast) -> list[int]:
    """Joints of the fingers."""
    roles = [role for side in SIDES for role in arm_roles(side)[4:]]
    return [joint for role in roles for joint in cast.joints.get(role, ())]


def _median(colors: np.ndarray) -> np.ndarray:
    """(3,) of colours (P, 3); infinitely far from any colour where there are none."""
    return np.median(colors, axis=0) if len(colors) else np.full(3, np.inf)
