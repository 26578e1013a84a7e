"""How large Gaussians on a skeleton may be."""

import numpy as np
import pytest
import torch

from ico3d.body.skinning.sizes import PART, bone_lengths, largest_log_scales

PARENTS = (-1, 0, 1, 1)
JOINTS = torch.tensor([[0.0, 0, 0], [0, 0.4, 0], [0, 0.4, 0.1], [0.3, 0.4, 0]])


def test_bones_reach_to_the_farthest_child():
    """Those of tips to their parent; a single joint has none."""
    found = bone_lengths(PARENTS, JOINTS)
    torch.testing.assert_close(found, torch.tensor([0.4, 0.3, 0.1, 0.3]))
    assert bone_lengths((-1,), JOINTS[:1]).tolist() == [np.inf]


def test_the_joint_that_carries_most_counts():
    joints = torch.tensor([[0, 1, 2, 3], [2, 0, 1, 3]], dtype=torch.int32)
    logits = torch.tensor([[0.0, 2.0, 1.0, -9.0], [5.0, 0.0, 0.0, 0.0]])
    found = largest_log_scales(bone_lengths(PARENTS, JOINTS), joints, logits)
    assert found[:, 0].exp().tolist() == pytest.approx([PART * 0.3, PART * 0.1])
