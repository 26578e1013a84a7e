"""Forward kinematics in torch: `ico3d.rig.rig.Rig.posed` with gradients."""

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
"""(4, 4, 4): contracted with a quaternion a along its last axis it is the matrix of b ↦ a·b."""


def unit(quats: Tensor) -> Tensor:
    """Quaternions (..., 4) of length 1 with w ≥ 0.

    Multiplied from the root outwards such quaternions have signs that agree with the parent's, so
    that neighbouring joints' can be blended.
    """
    signed = torch.where(quats[..., :1] < 0, -quats, quats)
    return torch.nn.functional.normalize(signed, dim=-1)


def left_matrices(quats: Tensor) -> Tensor:
    """(..., 4, 4) matrices L(a) with L(a)·b the Hamilton product a·b; quats (..., 4)."""
    return torch.einsum("rck,...k->...rc", LEFT.to(quats), quats)


def posed_joints(
    parents: Sequence[int], joints: Tensor, rotations: Tensor, root: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Where each joint is and how it is turned, all joints of one depth at a time.

    Args:
        parents: J numbers, −1 for joint 0.
        joints: (J, 3) at rest.
        rotations: (J, 4) wxyz of each joint about itself, need not be normalised.
        root: (3,) metres that the root moves.

    Returns:
        Rotations from rest space to the world as matrices (J, 3, 3) and as quaternions (J, 4)
        whose signs agree with their parents'; places (J, 3) in the world.
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
    """(J, 16) what takes each joint's points from rest to the world.

    A row holds the rotation matrix R (9), the shift t (3) of x ↦ R·x + t, and the rotation's
    quaternion (4), whose sign agrees with its parent's. Arguments as for `posed_joints`.
    """
    turned, quats, places = posed_joints(parents, joints, rotations, root)
    shift = places - (turned @ joints[:, :, None])[..., 0]  # (J, 3)
    return torch.cat([turned.flatten(1), shift, quats], 1)  # (J, 16)


@lru_cache(16)
def _levels(parents: tuple[int, ...]) -> tuple[list[list[int]], list[int], list[list[int]]]:
    """Joints by depth, where each joint is among all of them, and parents' places in the level."""
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
