"""Roles in rigs, and that a pose by role is the same pose in every rig."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.errors import SettingsError
from ico3d.motion.retarget import DOWN, PALM, retarget
from ico3d.motion.roles import INDEX, MIRROR, NEEDED, PARENTS, ROLES, SIDES, cast
from ico3d.motion.turning import unit
from ico3d.rig.quaternions import IDENTITY, from_rotvec, rotate
from ico3d.rig.rig import Rig
from support.rigs import rig_of

RIGS = {
    "A": rig_of("MakeHuman", 45.0, 35.0),
    "T": rig_of("SMPL-X", 0.0, 0.0),
    "hanging": rig_of("SMPL-X", 80.0, 10.0, 1.1),
}
BONES = (
    ("left_shoulder", "left_elbow"),
    ("left_elbow", "left_wrist"),
    ("right_shoulder", "right_elbow"),
    ("right_elbow", "right_wrist"),
    ("left_wrist", "left_middle1"),
    ("right_index1", "right_index2"),
)


def directions(name: str, pose: np.ndarray) -> np.ndarray:
    """(B, ..., 3) where the bones of a rig point."""
    fitted = retarget(RIGS[name])
    places = fitted.rig.posed(fitted.pose(pose), np.zeros(3))[1]
    joints = {role: found[0] for role, found in fitted.cast.joints.items()}
    return np.stack([unit(places[..., joints[b], :] - places[..., joints[a], :]) for a, b in BONES])


def random_pose(seed: int, size: float = 0.6) -> np.ndarray:
    """(5, R, 4) whose wrists do not twist: forearms do."""
    vectors = np.random.default_rng(seed).normal(size=(5, len(ROLES), 3)) * size
    vectors[:, [INDEX[f"{side}_wrist"] for side in SIDES], 1] = 0
    return from_rotvec(vectors)


@pytest.mark.parametrize("name", RIGS)
def test_in_the_standard_pose_arms_hang_and_palms_look_at_the_thighs(name):
    pose = np.tile(IDENTITY, (len(ROLES), 1))
    np.testing.assert_allclose(directions(name, pose), np.tile(DOWN, (len(BONES), 1)), atol=1e-9)
    fitted = retarget(RIGS[name])
    places = fitted.rig.posed(fitted.pose(pose), np.zeros(3))[1]
    for side in SIDES:
        index, little, wrist = (
            places[fitted.cast.joints[f"{side}_{part}"][0]]
            for part in ("index1", "little1", "wrist")
        )
        sign = 1.0 if side == "right" else -1.0
        palm = sign * unit(np.cross(DOWN, little - index))
        np.testing.assert_allclose(palm, PALM[side], atol=1e-9)
        assert abs(wrist[0]) > 0.15


@settings(max_examples=6)
@given(st.integers(0, 1000))
def test_bones_point_the_same_way_in_every_rig(seed):
    pose = random_pose(seed)
    world = retarget(RIGS["A"]).world(pose)
    wanted = np.stack([rotate(world[:, INDEX[a]], DOWN) for a, _ in BONES])
    for name in RIGS:
        np.testing.assert_allclose(directions(name, pose), wanted, atol=1e-7)


@pytest.mark.parametrize("name", RIGS)
def test_poses_come_back(name):
    fitted = retarget(RIGS[name])
    pose = random_pose(3, 0.4)
    found = fitted.by_role(fitted.pose(pose))
    np.testing.assert_allclose(np.abs((found * pose).sum(-1)), 1, atol=1e-9)


def test_a_turn_is_shared_by_the_joints_of_its_role():
    fitted = retarget(RIGS["A"])
    pose = np.tile(IDENTITY, (len(ROLES), 1))
    pose[INDEX["neck"]] = from_rotvec(np.array([0.0, 0.6, 0.0]))
    rotations = fitted.pose(pose)
    for joint in fitted.cast.joints["neck"]:
        np.testing.assert_allclose(rotations[joint], from_rotvec(np.array([0, 0.2, 0])), atol=1e-12)


@pytest.mark.parametrize("role", NEEDED)
def test_a_rig_that_lacks_a_needed_role_is_refused(role):
    rig = RIGS["T"]
    name = rig.names[cast(rig).joints[role][0]]
    names = tuple(
        f"other{i}" if i in cast(rig).joints[role] else n for i, n in enumerate(rig.names)
    )
    assert name not in names
    with pytest.raises(SettingsError, match=f"no joint for {role}: joints must be named"):
        cast(Rig(names, rig.parents, rig.joints))


def test_a_rig_without_fingers_and_collarbones_is_posed_all_the_same():
    rig = RIGS["T"]
    there = cast(rig).joints
    kept = [
        i for i in range(len(rig))
        if not any(i in j for r, j in there.items() if r[-1].isdigit() or "clavicle" in r)
    ]  # fmt: skip
    parents = []
    for joint in kept:
        parent = rig.parents[joint]
        while parent >= 0 and parent not in kept:
            parent = rig.parents[parent]
        parents.append(kept.index(parent) if parent >= 0 else -1)
    names = tuple(rig.names[i] for i in kept)
    bare = retarget(Rig(names, tuple(parents), rig.joints[kept]))
    pose = random_pose(1)
    pose[:, [INDEX[f"{side}_clavicle"] for side in SIDES]] = IDENTITY
    places = bare.rig.posed(bare.pose(pose), np.zeros(3))[1]
    joints = bare.cast.joints
    for a, b in (("left_shoulder", "left_elbow"), ("right_elbow", "right_wrist")):
        found = unit(places[:, joints[b][0]] - places[:, joints[a][0]])
        wanted = rotate(bare.world(pose)[:, INDEX[a]], DOWN)
        np.testing.assert_allclose(found, wanted, atol=1e-7)


def test_parents_come_before_children_and_mirrors_are_their_own_inverse():
    assert all(parent < number for number, parent in enumerate(PARENTS))
    np.testing.assert_array_equal(MIRROR[MIRROR], np.arange(len(ROLES)))
    assert ROLES[MIRROR[INDEX["left_index2"]]] == "right_index2"
