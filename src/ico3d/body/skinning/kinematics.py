"""Forward kinematics in torch, with gradients; as `ico3d.rig.rig.Rig` does it in numpy."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import torch
from torch import Tensor

from ico3d.splat.quaternions import to_matrix

LEFT = torch.tensor(
    [
        [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, -1]],
        [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, -1], [0, 0, 1, 0]],
        [[0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [0, -1, 0, 0]],
        [[0, 0, 0, 1], [0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, 0]],
    ]
).float()
"""(4, 4, 4): contracted along its last axis with a quaternion a, it is the matrix of b ↦ a·b."""


def unit(quats: Tensor) -> Tensor:
    """Quaternions (..., 4), scaled to length 1, with signs such that w ≥ 0.

    Products of such quaternions from the root outwards have the same sign as their parents'
    products, so that those of neighbouring joints can be blended.
    """
    signed = torch.where(quats[..., :1] < 0, -quats, quats)
    return torch.nn.functional.normalize(signed, dim=-1)


def left_matrices(quats: Tensor) -> Tensor:
    """(..., 4, 4) matrices L(a) of quaternions a (..., 4): L(a)·b is the Hamilton product a·b."""
    return torch.einsum("rck,...k->...rc", LEFT.to(quats), quats)


def posed_joints(
    parents: Sequence[int], joints: Tensor, rotations: Tensor, root: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Rotations and positions of posed joints; joints of one depth are computed together.

    Args:
        parents: Index of each joint's parent, −1 for joint 0.
        joints: (J, 3) positions at rest, metres.
        rotations: (J, 4) local rotation of each joint, wxyz, not necessarily normalised.
        root: (3,) translation of the root from rest, metres.

    Returns:
        Rotations from rest space to the world, as matrices (J, 3, 3) and as quaternions (J, 4)
        whose signs agree with their parents'; positions (J, 3) in the world, metres.
    """
    depths, order, above = _levels(tuple(parents))
    local = unit(rotations)  # (J, 4)
    bones = torch.cat([joints[:1] + root, joints[1:] - joints[list(parents[1:])]])  # (J, 3)
    rigid = torch.cat([to_matrix(local), bones[:, :, None]], 2)  # (J, 3, 4)
    last = rigid.new_tensor([0.0, 0, 0, 1]).expand(len(rigid), 1, 4)  # (J, 1, 4)
    both = torch.stack([torch.cat([rigid, last], 1), left_matrices(local)], 1)  # (J, 2, 4, 4)
    levels = [both[depths[0]]]  # (1, 2, 4, 4)
    for members, parent in zip(depths[1:], above[1:], strict=True):
        levels.append(levels[-1][parent] @ both[members])  # (M, 2, 4, 4)
    world = torch.cat(levels)[order]  # (J, 2, 4, 4)
    return world[:, 0, :3, :3], world[:, 1, :, 0], world[:, 0, :3, 3]  # L(q)·1 is q


def transforms(parents: Sequence[int], joints: Tensor, rotations: Tensor, root: Tensor) -> Tensor:
    """(J, 16) rigid transforms x ↦ R·x + t of each joint, from rest space to the world.

    A row holds the rotation matrix R (9), the translation t (3), and the quaternion of the rotation
    (4), whose sign agrees with that of its parent.

    Args:
        parents: Index of each joint's parent, −1 for joint 0.
        joints: (J, 3) positions at rest, metres.
        rotations: (J, 4) local rotation of each joint, wxyz, not necessarily normalised.
        root: (3,) translation of the root from rest, metres.
    """
    turned, quats, places = posed_joints(parents, joints, rotations, root)
    shift = places - (turned @ joints[:, :, None])[..., 0]  # (J, 3)
    return torch.cat([turned.flatten(1), shift, quats], 1)  # (J, 16)


@lru_cache(16)
def _levels(parents: tuple[int, ...]) -> tuple[list[list[int]], list[int], list[list[int]]]:
    """Groups joints by their depth in the skeleton.

    Returns:
        The joints of each depth; for each joint its place in these lists, joined; and for each
        joint of a depth the place of its parent among the joints of the depth above.
    """
    depth = [0] * len(parents)
    for joint, parent in enumerate(parents):
        depth[joint] = depth[parent] + 1 if parent >= 0 else 0
    levels = [[j for j, d in enumerate(depth) if d == level] for level in range(max(depth) + 1)]
    flat = [joint for level in levels for joint in level]
    order = [0] * len(flat)
    for place, joint in enumerate(flat):
        order[joint] = place
    above = [[]] + [
        [before.index(parents[joint]) for joint in level] for before, level in pairwise(levels)
    ]
    return levels, order, above
