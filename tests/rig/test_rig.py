"""Bones and quaternions against closed forms, scipy, and the studio's independent skeleton."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from ico3d.rig.binding import Binding
from ico3d.rig.quaternions import (
    conjugate,
    continuous,
    from_matrix,
    from_rotvec,
    multiply,
    normalized,
    rotate,
    slerp,
    to_matrix,
    to_rotvec,
)
from ico3d.rig.rig import Rig
from ico3d.studio.person.skeleton import Skeleton

ARM = Rig(("root", "upper", "lower"), (-1, 0, 1), np.array([[0, 1, 0], [0.2, 1, 0], [0.5, 1, 0.0]]))

seeds = st.integers(0, 2**32 - 1)


def scipy_of(quats):
    return Rotation.from_quat(np.roll(quats, -1, -1))


def random_rig(rng, count):
    parents = (-1, *(int(rng.integers(0, joint)) for joint in range(1, count)))
    return Rig(tuple(f"j{i}" for i in range(count)), parents, rng.normal(0, 0.4, (count, 3)))


@given(seeds)
def test_quaternions_agree_with_scipy(seed):
    rng = np.random.default_rng(seed)
    a, b = normalized(rng.normal(size=(2, 7, 4)))
    vectors = rng.normal(size=(7, 3))
    np.testing.assert_allclose(to_matrix(a), scipy_of(a).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rotate(a, vectors), scipy_of(a).apply(vectors), atol=1e-12)
    both = scipy_of(a) * scipy_of(b)
    np.testing.assert_allclose(to_matrix(multiply(a, b)), both.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(to_rotvec(a), scipy_of(a).as_rotvec(), atol=1e-9)
    np.testing.assert_allclose(to_matrix(from_rotvec(to_rotvec(a))), to_matrix(a), atol=1e-12)
    np.testing.assert_allclose(to_matrix(from_matrix(to_matrix(a))), to_matrix(a), atol=1e-12)
    np.testing.assert_allclose(multiply(a, conjugate(a)), np.tile([1, 0, 0, 0], (7, 1)), atol=1e-12)


@given(seeds, st.floats(0, 1))
def test_slerp_is_scipys(seed, part):
    rng = np.random.default_rng(seed)
    a, b = normalized(rng.normal(size=(2, 4)))
    expected = Slerp([0, 1], scipy_of(np.stack([a, b])))(part).as_matrix()
    np.testing.assert_allclose(to_matrix(slerp(a, b, part)), expected, atol=1e-9)


def test_what_is_no_rotation_becomes_the_identity():
    np.testing.assert_array_equal(normalized(np.zeros((2, 4))), [[1, 0, 0, 0]] * 2)
    np.testing.assert_array_equal(from_rotvec(np.zeros(3)), [1, 0, 0, 0])
    np.testing.assert_array_equal(to_rotvec(np.array([1.0, 0, 0, 0])), [0, 0, 0])


def test_neighbours_in_time_have_the_same_sign():
    turns = from_rotvec(np.linspace([0, 0, 0], [0, 9, 0], 40))
    shuffled = turns * np.random.default_rng(0).choice([-1, 1], 40)[:, None]
    found = continuous(shuffled)
    assert ((found[1:] * found[:-1]).sum(-1) > 0.9).all()
    np.testing.assert_allclose(to_matrix(found), to_matrix(turns), atol=1e-12)


def test_a_bent_elbow_in_closed_form():
    rotations = ARM.rest()
    rotations[2] = from_rotvec(np.array([0, 0, np.pi / 2]))  # the lower arm turns up
    matrices = ARM.matrices(rotations, np.array([0, 0, 0.1]))
    wrist = np.array([0.8, 1, 0, 1])  # 0.3 m beyond the elbow
    np.testing.assert_allclose(matrices[2] @ wrist, [0.5, 1.3, 0.1, 1], atol=1e-12)
    np.testing.assert_allclose(matrices[1] @ wrist, [0.8, 1, 0.1, 1], atol=1e-12)


@settings(max_examples=20)
@given(seeds)
def test_it_moves_as_the_studios_skeleton(seed):
    rng = np.random.default_rng(seed)
    rig = random_rig(rng, 9)
    quats, root = normalized(rng.normal(size=(3, 9, 4))), rng.normal(size=(3, 3))
    dense = rng.random((20, 9)) ** 8
    binding = Binding.strongest(dense)
    studio = Skeleton(rig.names, np.array(rig.parents), rig.joints, binding.dense(9))
    expected = studio.matrices(to_matrix(quats), root)
    np.testing.assert_allclose(rig.matrices(quats, root), expected, atol=1e-12)
    at = np.concatenate([rig.joints, np.ones((9, 1))], 1)
    places = np.einsum("fjab,jb->fja", expected, at)[..., :3]
    np.testing.assert_allclose(rig.posed(quats, root)[1], places, atol=1e-12)
    vertices = rng.normal(size=(20, 3))
    moved = studio.skinned(vertices, expected[0])
    np.testing.assert_allclose(binding.skinned(vertices, expected[0]), moved, atol=1e-5)


def test_the_strongest_four_sum_to_one():
    dense = np.array([[0.1, 0.2, 0.05, 0.3, 0.35, 0.0]])
    binding = Binding.strongest(dense)
    assert binding.joints.tolist() == [[4, 3, 1, 0]]
    np.testing.assert_allclose(binding.weights, np.array([[0.35, 0.3, 0.2, 0.1]]) / 0.95)
    assert Binding.strongest(np.ones((1, 2))).weights.tolist() == [[0.5, 0.5, 0, 0]]


@pytest.mark.parametrize(
    ("names", "parents", "joints", "why"),
    [
        (("a", "a"), (-1, 0), np.zeros((2, 3)), "different names"),
        ((), (), np.zeros((0, 3)), "1 to 256"),
        (("a", "b"), (-1,), np.zeros((2, 3)), "differ in number"),
        (("a", "b"), (0, -1), np.zeros((2, 3)), "root"),
        (("a", "b", "c"), (-1, 2, 0), np.zeros((3, 3)), "before children"),
        (("a",), (-1,), np.full((1, 3), np.nan), "more than 10 m"),
    ],
)
def test_what_is_no_tree_is_refused(names, parents, joints, why):
    with pytest.raises(ValueError, match=why):
        Rig(names, parents, joints)
