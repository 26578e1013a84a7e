"""The evaluator of a body on a skeleton does what the format says, and what training does."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.bundle.skinned.packing import packed_rotations, packed_weights
from ico3d.bundle.skinned.posing import (
    any_pose,
    harmonics,
    joint_table,
    posed,
    recorded_pose,
)
from ico3d.bundle.tensors import QUAT_UNIT
from ico3d.rig.quaternions import from_rotvec, multiply, normalized, rotate, to_rotvec
from support.bundles.random_skinned import random_skinned

pytestmark = pytest.mark.slow

BAKED = random_skinned()
SECOND = [0.282094792 * math.sqrt(15), 0.282094792 * math.sqrt(5) / 2]


def loop_evaluation(baked, pose) -> list[np.ndarray]:
    """Slowly, from the format's description alone."""
    turned, places = baked.rig.posed(pose.rotations, pose.root)
    means, quats, colors = [], [], []
    for n in range(baked.info.num_gaussians):
        rest, logits = baked.means[n].astype(float), baked.color_logits[n].astype(float)
        for k, much in enumerate(pose.residual):
            rest = rest + much * baked.shapes[n, k, :3] * float(baked.shape_scales[n, 0]) / 1000
            logits = logits + much * baked.shapes[n, k, 3:] * float(baked.shape_scales[n, 1])
        mean, quat, facing = np.zeros(3), np.zeros(4), np.zeros(3)
        for joint, weight in zip(baked.joints[n], baked.weights[n] / 255, strict=True):
            mean += weight * (rotate(turned[joint], rest - baked.rig.joints[joint]) + places[joint])
            quat += weight * turned[joint]  # turns are small: all signs agree
            facing += weight * rotate(turned[joint], baked.normals[n].astype(float))
        x, y, z = facing / np.linalg.norm(facing)
        a, b = SECOND
        light = [*(0.48860251 * np.array([-y, z, -x])), a * x * y, -a * y * z]
        light += [b * (3 * z * z - 1), -a * x * z, a / 2 * (x * x - y * y)]
        facing = np.array([x, y, z])
        logits = logits + np.array(light) @ baked.light
        reach = slow_reach(baked.lamp, turned, places, baked.rig.joints, mean + 0.01 * facing)
        lit = max(facing @ baked.lamp.lamp_direction + 0.2, 0)
        logits = logits + np.log(1 + reach * lit * baked.lamp.lamp_strength)
        means.append(mean)
        quats.append(normalized(multiply(quat, baked.quats[n].astype(float))))
        colors.append(1 / (1 + np.exp(-logits)))
    return [np.array(values) for values in (means, quats, colors)]


def slow_reach(lamp, turned, places, joints, point) -> float:
    """Share of the lamp's light at a point, sphere by sphere."""
    towards = lamp.lamp_direction.astype(float)
    across = np.cross([0, 1, 0], towards) / np.linalg.norm(np.cross([0, 1, 0], towards))
    axes = np.stack([across, np.cross(towards, across), towards])
    share, (u, v, height) = 0.0, axes @ point
    spheres = []
    for rest, carried, parts in zip(
        lamp.caster_points * 1e-4, lamp.caster_joints, lamp.caster_weights / 255, strict=True
    ):
        centre = np.zeros(3)
        for joint, weight in zip(carried, parts, strict=True):
            centre += weight * (rotate(turned[joint], rest - joints[joint]) + places[joint])
        spheres.append(axes @ centre)
    for row in range(math.floor(v / 0.0125) - 1, math.floor(v / 0.0125) + 3):
        for column in range(math.floor(u / 0.0125) - 1, math.floor(u / 0.0125) + 3):
            nearest = -math.inf
            for x, y, z in spheres:
                left = 0.02**2 - (column * 0.0125 - x) ** 2 - (row * 0.0125 - y) ** 2
                nearest = max(nearest, z + math.sqrt(left)) if left >= 0 else nearest
            weight = (1 - abs(u / 0.0125 - column) / 2) * (1 - abs(v / 0.0125 - row) / 2)
            share += weight / 4 * min(max((height + 0.03 - nearest) / 0.002 + 0.5, 0), 1)
    return share


@pytest.mark.parametrize("frame", [0.0, 1.0, 2.6, 5.0])
def test_the_evaluator_does_what_the_format_says(frame):
    pose = recorded_pose(BAKED, frame)
    drawn = posed(BAKED, pose)
    means, quats, colors = loop_evaluation(BAKED, pose)
    np.testing.assert_allclose(drawn.means, means, atol=1e-5)
    np.testing.assert_allclose(np.abs((drawn.quats * quats).sum(1)), 1, atol=1e-5)
    np.testing.assert_allclose(drawn.rgb, colors, atol=1e-5)
    np.testing.assert_allclose(drawn.scales, np.exp(BAKED.log_scales.astype(float)), rtol=1e-5)
    np.testing.assert_allclose(drawn.opacities, BAKED.opacities / 255, rtol=1e-6)


def test_any_prefix_is_a_body():
    """The first n Gaussians look as they do among all of them."""
    pose = recorded_pose(BAKED, 3.3)
    few, all_of_them = posed(BAKED, pose, 7), posed(BAKED, pose)
    for name, values in vars(few).items():
        np.testing.assert_array_equal(values, getattr(all_of_them, name)[:7])


def test_a_recorded_pose_is_what_was_recorded():
    pose = recorded_pose(BAKED, 4.0)
    np.testing.assert_allclose(
        pose.rotations[BAKED.moving], BAKED.rotations[4] / QUAT_UNIT, atol=1e-4
    )
    np.testing.assert_allclose(pose.rotations[3], BAKED.held[3] / QUAT_UNIT, atol=1e-4)
    np.testing.assert_allclose(pose.root, BAKED.roots[4])
    np.testing.assert_allclose(pose.residual, BAKED.coefficients[4])
    np.testing.assert_array_equal(recorded_pose(BAKED, 99.0).root, recorded_pose(BAKED, 5.0).root)


@given(st.floats(0, 5))
def test_motion_is_continuous(frame):
    a, b = (recorded_pose(BAKED, place) for place in (frame, min(frame + 1e-4, 5.0)))
    assert np.abs(a.rotations - b.rotations).max() < 1e-3
    assert np.abs(a.root - b.root).max() < 1e-3


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_coefficients_of_any_pose_are_those_that_training_interpolates(seed):
    """Of all joints, held ones too; also for a pose far from all known ones."""
    import torch

    from ico3d.body.skinning.coefficients import interpolated

    rng = np.random.default_rng(seed)
    known = recorded_rotations(BAKED)[BAKED.known]
    pose = known[2] + rng.normal(0, rng.choice([0.01, 0.3, 3]), (5, 4))
    mixed = torch.from_numpy(BAKED.coefficients[BAKED.known]).double()
    expected = interpolated(torch.from_numpy(known), mixed, torch.from_numpy(pose))
    found = any_pose(BAKED, pose, np.zeros(3)).residual
    np.testing.assert_allclose(found, expected, atol=1e-4)


def recorded_rotations(baked) -> np.ndarray:
    """(F, J, 4)."""
    return np.stack([recorded_pose(baked, f).rotations for f in range(baked.info.num_frames)])


def test_the_joint_table_is_that_of_training():
    import torch

    from ico3d.body.skinning.kinematics import transforms

    pose = recorded_pose(BAKED, 1.7)
    parts = (BAKED.rig.joints, pose.rotations, pose.root)
    row = transforms(BAKED.rig.parents, *(torch.from_numpy(part) for part in parts)).numpy()
    expected = np.concatenate([row[:, :9].reshape(-1, 3, 3), row[:, 9:12, None]], 2)
    found = joint_table(BAKED, pose)
    np.testing.assert_allclose(found[:, :12].reshape(-1, 3, 4), expected, atol=1e-9)
    np.testing.assert_allclose(found[:, 12:], row[:, 12:], atol=1e-9)


def test_signs_of_quaternions_agree_with_their_parents():
    """An arm that is turned by nearly a full turn of its chest is blended the short way."""
    baked = BAKED
    rotations = baked.rig.rest()
    rotations[1] = from_rotvec(np.array([0, 3.0, 0]))
    rotations[2] = from_rotvec(np.array([0, 0.5, 0]))
    quats = joint_table(baked, any_pose(baked, rotations, np.zeros(3)))[:, 12:]
    assert (quats[1] * quats[2]).sum() > 0.9
    np.testing.assert_allclose(np.linalg.norm(to_rotvec(quats[2])), 2 * np.pi - 3.5, atol=1e-9)


def test_light_has_the_harmonics_of_colours():
    import torch

    from ico3d.splat.harmonics import basis

    normals = normalized(np.random.default_rng(0).normal(size=(9, 4)))[:, 1:]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(
        harmonics(normals), basis(torch.from_numpy(normals), 2)[:, 1:], atol=1e-12
    )


def test_joints_that_stand_still_are_kept_once():
    """Whoever turns by less than the tolerance is held; all others are as they were."""
    rng = np.random.default_rng(0)
    turns = np.zeros((9, 4, 3))
    turns[:, 0] = rng.normal(0, 0.5, (9, 3))
    turns[:, 1] = (0.3, 0, 0)  # held, but not at rest
    turns[:, 2, 0] = np.radians(0.01) * (-1.0) ** np.arange(9)
    turns[:, 3, 1] = np.radians(0.2) * (-1.0) ** np.arange(9)
    given = from_rotvec(turns)
    held, moving, rotations = packed_rotations(given, 0.05)
    assert moving.tolist() == [0, 3]
    np.testing.assert_allclose(to_rotvec(held / QUAT_UNIT)[1], (0.3, 0, 0), atol=1e-4)
    dots = np.abs((rotations / QUAT_UNIT * given[:, [0, 3]]).sum(-1))
    np.testing.assert_allclose(dots, 1, atol=1e-4)
    assert len(packed_rotations(given[:, 1:2], 0.05)[1]) == 1  # the root moves by definition


@given(st.integers(0, 1000))
def test_weights_keep_their_sum(seed):
    weights = np.random.default_rng(seed).dirichlet(np.full(4, 0.3), 20)
    found = packed_weights(weights)
    assert (found.sum(1, dtype=int) == 255).all()
    assert np.abs(found - 255 * weights).max() < 1
