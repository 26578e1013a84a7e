"""Gaussians on a skeleton."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.body.motion.window_model import WindowModel
from ico3d.body.skinning.coefficients import initial_network, interpolated, network
from ico3d.body.skinning.skinned import NETWORK, Skinned, without_residual
from ico3d.splat.quaternions import to_matrix
from support.bodies.window_parts import canonical

ARM = Skinned(("root", "elbow"), (-1, 0), 3, 2, 5, True)
"""An upper arm along +x and what hangs on the elbow, one metre along."""
QUARTER = torch.tensor([math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)])
"""A quarter turn about z."""


def arm_tensors(motion=ARM, count=5, seed=0, dtype=torch.float32):
    """Random tensors of an arm: straight, turned a little, and bent by a quarter."""
    generator = torch.Generator().manual_seed(seed)

    def random(*shape):
        return torch.randn(*shape, generator=generator)

    rotations = torch.tensor([1.0, 0, 0, 0]).repeat(3, 2, 1)  # (3, 2, 4)
    rotations[1] += 0.1 * random(2, 4)
    rotations[2, 1] = QUARTER
    values = canonical(count) | {
        "skin_joints": torch.tensor([[0, 1, 0, 0]], dtype=torch.int32).repeat(count, 1),
        "skin_logits": torch.cat([random(count, 2), torch.full((count, 2), -30.0)], 1),
        "rig_joints": torch.tensor([[0.0, 0, 0], [1.0, 0, 0]]),
        "pose_rotations": rotations,
        "pose_roots": torch.tensor([[0.0, 0, 0], [0.1, 0.2, 0.3], [0, 0, 0]]),
    }
    if motion.light:
        values["normals"] = torch.nn.functional.normalize(random(count, 3), dim=1)
        values["light"] = random(8, 3)
    if motion.shapes:
        values |= {f"shape_{n}": random(count, 3, motion.shapes) for n in ("means", "colors")}
        net = initial_network(rotations, motion.hidden, motion.shapes, generator)
        values |= {NETWORK + name: value for name, value in net.items()}
    return {n: v.to(dtype) if v.is_floating_point() else v for n, v in values.items()}


BARE = Skinned(ARM.names, ARM.parents, 3, 0, 0, False)


def test_at_rest_nothing_changes():
    """Where no joint is turned the canonical Gaussians are drawn as they are."""
    values = arm_tensors(BARE)
    gaussians = BARE.at(values, 0.0)
    torch.testing.assert_close(gaussians.means, values["means"])
    torch.testing.assert_close(gaussians.quats, values["quats"])
    torch.testing.assert_close(gaussians.colors, values["color_logits"].sigmoid())


def test_a_bent_elbow():
    """What hangs on the elbow turns about it, what hangs half on it is half as far."""
    values = arm_tensors(BARE, 3) | {
        "means": torch.tensor([[1.5, 0.0, 0.0]] * 3),
        "quats": torch.tensor([[1.0, 0, 0, 0]] * 3),
        "skin_logits": torch.tensor([[0.0, -50], [-50, 0], [0, 0]]).repeat_interleave(1, 0),
    }
    values["skin_logits"] = torch.cat([values["skin_logits"], torch.full((3, 2), -50.0)], 1)
    gaussians = BARE.at(values, 1.0)
    expected = torch.tensor([[1.5, 0, 0], [1.0, 0.5, 0], [1.25, 0.25, 0]])
    torch.testing.assert_close(gaussians.means, expected)
    turns = to_matrix(gaussians.quats)[:, :2, 0]  # (3, 2): where +x goes
    half = math.sqrt(0.5)
    torch.testing.assert_close(turns, torch.tensor([[1.0, 0], [0, 1], [half, half]]))


def test_shapes_move_and_color_before_skinning():
    """By the network's coefficients; without them nothing is left of them."""
    motion = Skinned(ARM.names, ARM.parents, 3, 2, 5, False)
    values = arm_tensors(motion)
    pose = motion.pose_at(values, 1.0)
    named = {n.removeprefix(NETWORK): v for n, v in values.items() if n.startswith(NETWORK)}
    mixed = network(named, values["pose_rotations"][2])  # (2,)
    baked = values | {
        "means": values["means"] + values["shape_means"] @ mixed,
        "color_logits": values["color_logits"] + values["shape_colors"] @ mixed,
    }
    plain = {n: v for n, v in baked.items() if "shape" not in n and NETWORK not in n}
    expected, found = BARE.at(plain, 1.0), motion.at(values, 1.0)
    torch.testing.assert_close(found.means, expected.means)
    torch.testing.assert_close(found.colors, expected.colors)
    bare = motion.drawn(values, without_residual(pose))
    torch.testing.assert_close(bare.means, BARE.at(values, 1.0).means)


def test_light_follows_the_normal():
    """A term of degree 1 along −x lightens what faces that way after posing, not before."""
    motion = Skinned(ARM.names, ARM.parents, 3, 0, 0, True)
    values = arm_tensors(motion, 1) | {
        "skin_logits": torch.tensor([[-50.0, 0, -50, -50]]),
        "normals": torch.tensor([[0.0, 1.0, 0.0]]),
        "light": torch.zeros(8, 3).index_fill(0, torch.tensor([2]), 1.0),
    }
    straight, bent = (motion.at(values, tau).colors.logit() for tau in (0.0, 1.0))
    torch.testing.assert_close(straight, values["color_logits"])
    torch.testing.assert_close(bent - straight, torch.full((1, 3), 0.48860251), atol=1e-4, rtol=0)


def test_between_frames_joints_turn_on_the_arc():
    """Half-way between straight and a quarter turn is an eighth of a turn."""
    motion = Skinned(ARM.names, ARM.parents, 2, 2, 5, True)
    values = arm_tensors()
    for name in ("pose_rotations", "pose_roots"):
        values[name] = values[name][[0, 2]] + (0 if "rot" in name else 1)
    pose = motion.pose_at(values, 0.5)
    eighth = torch.tensor([math.cos(math.pi / 8), 0, 0, math.sin(math.pi / 8)])
    torch.testing.assert_close(pose.rotations[1], eighth)
    ends = [motion.pose_at(values, tau) for tau in (0.0, 1.0)]
    assert pose.residual is not None
    torch.testing.assert_close(pose.residual, (ends[0].residual + ends[1].residual) / 2)
    near = motion.at(values, 1 - 1e-5).means
    torch.testing.assert_close(near, motion.at(values, 1.0).means)


@pytest.mark.parametrize("motion", [ARM, BARE], ids=["skinned", "hugs"])
def test_gradients(motion):
    """Of all that is trained, by finite differences."""
    values = arm_tensors(motion, 3, dtype=torch.float64)
    names = [n for n in values if n not in motion.fixed and n != "opacity_logits"]
    # The network learns from the pose and not the other way round: see the next test.
    if motion.shapes:
        names.remove("pose_rotations")

    def drawn(*tensors):
        gaussians = motion.at({**values, **dict(zip(names, tensors, strict=True))}, 0.5)
        return gaussians.means, gaussians.quats, gaussians.colors

    inputs = [values[name].requires_grad_() for name in names]
    assert torch.autograd.gradcheck(drawn, inputs)


def test_poses_do_not_follow_the_network():
    """Their gradient is that of the skinning alone."""
    values = arm_tensors(dtype=torch.float64)
    values["pose_rotations"].requires_grad_()
    pose = ARM.pose_at(values, 0.5)
    (whole,) = torch.autograd.grad(ARM.at(values, 0.5).means.sum(), values["pose_rotations"])
    held = type(pose)(pose.rotations, pose.root, pose.residual.detach())
    (part,) = torch.autograd.grad(ARM.drawn(values, held).means.sum(), values["pose_rotations"])
    torch.testing.assert_close(whole, part)
    assert whole[1].abs().max() > 0 and not whole[[0, 2]].any()


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_coefficients_of_any_pose_stay_in_the_trained_range(seed):
    """However far the pose is from all that was trained."""
    generator = torch.Generator().manual_seed(seed)
    known = torch.randn(6, 4, 4, generator=generator)
    mixed = torch.randn(6, 3, generator=generator)
    for pose in (torch.randn(4, 4, generator=generator), known[2]):
        found = interpolated(known, mixed, pose)
        assert (found <= mixed.amax(0) + 1e-5).all() and (found >= mixed.amin(0) - 1e-5).all()


def test_a_trained_pose_far_from_others_has_its_own_coefficients():
    """The kernel is as narrow as trained poses are apart."""
    turns = torch.linspace(0, 3, 31)
    known = torch.stack([turns.cos(), turns.sin(), 0 * turns, 0 * turns], 1)[:, None]  # (31, 1, 4)
    mixed = torch.sin(turns)[:, None]
    found = interpolated(known, mixed, known[8])
    torch.testing.assert_close(found, mixed[8], atol=0.05, rtol=0)


def test_a_pose_unlike_all_trained_ones_has_a_mean_of_several():
    """Not what the nearest has: between two clusters of poses it is near the mean of both."""
    turns = torch.tensor([0.0, 0.01, 1.0, 1.01])
    known = torch.stack([turns.cos(), turns.sin(), 0 * turns, 0 * turns], 1)[:, None]  # (4, 1, 4)
    place = torch.tensor(0.4)
    pose = torch.stack([place.cos(), place.sin(), 0 * place, 0 * place])[None]
    mixed = torch.tensor([[0.0], [0.0], [1.0], [1.0]])
    assert 0.2 < float(interpolated(known, mixed, pose)) < 0.5


def test_any_pose_can_be_drawn():
    """A trained one as it was trained, but for the coefficients; any other one finite."""
    values = arm_tensors(BARE)
    found = BARE.posed(values, values["pose_rotations"][2], values["pose_roots"][2])
    torch.testing.assert_close(found.means, BARE.at(values, 1.0).means)
    away = torch.tensor([[0.0, 1, 0, 0], [0.3, 0.1, -0.9, 0.2]])
    assert ARM.posed(arm_tensors(), away, torch.ones(3)).drawable().all()


def test_the_names_are_those_of_the_tensors():
    """A window takes them, with and without light and residual."""
    for motion in (ARM, BARE):
        values = arm_tensors(motion)
        per_gaussian = {n: values[n] for n in (*canonical(), *motion.per_gaussian)}
        WindowModel(motion, per_gaussian, {n: values[n] for n in motion.shared})
        assert np.isin(list(values), [*per_gaussian, *motion.shared]).all()
