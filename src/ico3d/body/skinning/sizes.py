"""How large Gaussians on a skeleton may be: one longer than its bone would not bend with it."""

from collections.abc import Sequence

import torch
from torch import Tensor

PART = 0.25
"""Largest standard deviation of a Gaussian, relative to the length of the bone that carries it.

Without a limit, a Gaussian that fits a finger in all recorded poses sticks out of it in others.
"""


def bone_lengths(parents: Sequence[int], joints: Tensor) -> Tensor:
    """(J,) length in metres of the bone at each joint.

    It is the distance to the farthest child; for a joint without children, to the parent; inf for
    a joint without either, or where these distances are 0.

    Args:
        parents: Index of each joint's parent, −1 for joint 0.
        joints: (J, 3) positions at rest, metres.
    """
    lengths = joints.new_zeros(len(joints))
    above = [max(parent, 0) for parent in parents]
    to_parent = (joints - joints[above]).norm(dim=1)  # (J,)
    for joint, parent in enumerate(parents[1:], 1):
        lengths[parent] = torch.maximum(lengths[parent], to_parent[joint])
    lengths = torch.where(lengths == 0, to_parent, lengths)
    return lengths.masked_fill(lengths == 0, torch.inf)


def largest_log_scales(lengths: Tensor, joints: Tensor, logits: Tensor) -> Tensor:
    """(N, 1) logarithm of the largest standard deviation in metres that each Gaussian may have.

    Args:
        lengths: (J,) lengths of the bones, metres.
        joints: (N, 4) joints that carry each Gaussian.
        logits: (N, 4) logits of these joints' weights; the strongest joint gives the bone.
    """
    carrier = joints.gather(1, logits.argmax(1, keepdim=True))  # (N, 1)
    return (PART * lengths[carrier.long()]).log()
