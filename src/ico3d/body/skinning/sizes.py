"""How large a Gaussian on a skeleton may be: one that is longer than its bone does not bend."""

from collections.abc import Sequence

import torch
from torch import Tensor

PART = 0.25
"""Of the bone that carries a Gaussian, its largest standard deviation. A finger's Gaussian that
recorded pictures do not mind sticks out of the finger in the next pose."""


def bone_lengths(parents: Sequence[int], joints: Tensor) -> Tensor:
    """(J,) metres from each joint to its farthest child; of a tip, to its parent; inf of neither.

    Args:
        parents: J numbers, −1 for joint 0.
        joints: (J, 3) at rest.
    """
    lengths = joints.new_zeros(len(joints))
    above = [max(parent, 0) for parent in parents]
    to_parent = (joints - joints[above]).norm(dim=1)  # (J,)
    for joint, parent in enumerate(parents[1:], 1):
        lengths[parent] = torch.maximum(lengths[parent], to_parent[joint])
    lengths = torch.where(lengths == 0, to_parent, lengths)
    return lengths.masked_fill(lengths == 0, torch.inf)


def largest_log_scales(lengths: Tensor, joints: Tensor, logits: Tensor) -> Tensor:
    """(N, 1) log of metres that Gaussians may have as standard deviation.

    Args:
        lengths: (J,) metres of the bones.
        joints: (N, 4) which joints carry a Gaussian.
        logits: (N, 4) of how much.
    """
    carrier = joints.gather(1, logits.argmax(1, keepdim=True))  # (N, 1)
    return (PART * lengths[carrier.long()]).log()
