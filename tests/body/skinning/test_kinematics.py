"""Forward kinematics in torch."""

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.body.skinning.kinematics import left_matrices, posed_joints, transforms, unit
from ico3d.rig.rig import Rig
from ico3d.splat.quaternions import multiply, to_matrix


def random_rig(seed: int, joints: int) -> tuple[Rig, np.ndarray, np.ndarray]:
    """A rig of any shape, rotations (J, 4) of any length and sign, and a root (3,)."""
    rng = np.random.default_rng(seed)
    parents = (-1, *(int(rng.integers(joint)) for joint in range(1, joints)))
    rig = Rig(tuple(f"j{n}" for n in range(joints)), parents, rng.normal(size=(joints, 3)))
    return rig, rng.normal(size=(joints, 4)), rng.normal(size=3)


def in_torch(rig: Rig, rotations: np.ndarray, root: np.ndarray):
    """What the functions take, in double precision."""
    numbers = (rig.joints, rotations, root)
    return (rig.parents, *(torch.from_numpy(np.array(n, np.float64)) for n in numbers))


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.integers(1, 40))
def test_it_agrees_with_the_rig(seed, joints):
    """Places, rotations and matrices are those of numpy, for any tree."""
    rig, rotations, root = random_rig(seed, joints)
    length = np.linalg.norm(rotations, axis=1, keepdims=True)
    turned, places = rig.posed(rotations / length, root)
    matrices, quats, found = posed_joints(*in_torch(rig, rotations, root))
    np.testing.assert_allclose(found, places, atol=1e-9)
    np.testing.assert_allclose(matrices, to_matrix(torch.from_numpy(turned)), atol=1e-9)
    np.testing.assert_allclose(np.abs((quats.numpy() * turned).sum(1)), 1, atol=1e-9)
    table = transforms(*in_torch(rig, rotations, root)).numpy()
    expected = rig.matrices(rotations / length, root)
    np.testing.assert_allclose(table[:, :9].reshape(-1, 3, 3), expected[:, :3, :3], atol=1e-9)
    np.testing.assert_allclose(table[:, 9:12], expected[:, :3, 3], atol=1e-9)


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_signs_agree_with_the_parents(seed):
    """No quaternion points away from its parent's, so that both can be blended."""
    rig, rotations, root = random_rig(seed, 12)
    quats = posed_joints(*in_torch(rig, rotations, root))[1]  # (J, 4)
    for joint, parent in enumerate(rig.parents[1:], 1):
        assert quats[joint] @ quats[parent] >= 0


def test_left_matrices_multiply():
    """L(a)·b is the Hamilton product."""
    a, b = torch.randn(2, 9, 4, generator=torch.Generator().manual_seed(0))
    product = (left_matrices(a) @ b[:, :, None])[..., 0]
    torch.testing.assert_close(product, multiply(a, b))


def test_units_have_a_positive_real_part():
    """The same rotation, whatever length and sign it had."""
    quats = torch.randn(30, 4, generator=torch.Generator().manual_seed(0))
    found = unit(quats)
    assert (found[:, 0] >= 0).all()
    torch.testing.assert_close(found.norm(dim=1), torch.ones(30))
    torch.testing.assert_close(to_matrix(found), to_matrix(quats))


def test_gradients():
    """Of rotations, root and bones, by finite differences."""
    parents, *numbers = in_torch(*random_rig(1, 7))
    inputs = [number.requires_grad_() for number in numbers]
    assert torch.autograd.gradcheck(lambda *n: transforms(parents, *n), inputs)
