"""What holds for every scene, and what is drawn of scenes that are broken or empty."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.common.camera import Camera
from ico3d.splat import quaternions
from ico3d.splat.gaussians import cat
from ico3d.splat.render import render
from support.splats import reference
from support.splats.reference import camera_at

SEEDS = st.integers(0, 10_000)
FEW = settings(max_examples=15)


def random_scene(seed, count=40, coefficients=0):
    gaussians = reference.scene(count, seed, dtype=torch.float32)
    return reference.harmonic(gaussians, coefficients, seed)


def random_motion(seed, scale):
    """A similarity (4, 4) float64."""
    random = np.random.default_rng(seed)
    matrix = np.eye(4)
    turn = quaternions.to_matrix(torch.from_numpy(random.normal(size=4)))
    matrix[:3, :3], matrix[:3, 3] = scale * turn.numpy(), random.normal(size=3)
    return matrix


def views():
    return [camera_at((0, 0, 1.2)), camera_at((0.9, 0.3, -0.6))]


@FEW
@given(SEEDS, st.sampled_from([0, 4, 9, 16]))
def test_a_world_that_moves_with_its_cameras_looks_the_same(seed, coefficients):
    gaussians, motion = random_scene(seed, coefficients=coefficients), random_motion(seed, 1.0)
    cameras = views()
    moved = [camera.moved(np.linalg.inv(motion)) for camera in cameras]
    before, after = render(gaussians, cameras), render(gaussians.transform(motion), moved)
    # A pixel at a splat's rim may fall to either side of the least alpha.
    assert (before.rgb - after.rgb).abs().quantile(0.999) < 1e-4
    assert (before.rgb - after.rgb).abs().max() < 0.01


@FEW
@given(SEEDS)
def test_the_order_of_gaussians_does_not_matter(seed):
    gaussians = random_scene(seed)
    shuffled = gaussians[torch.randperm(40, generator=torch.Generator().manual_seed(seed))]
    assert torch.equal(render(gaussians, views()).rgb, render(shuffled, views()).rgb)


@FEW
@given(SEEDS, st.integers(1, 400))
def test_no_pixel_is_more_than_covered(seed, count):
    """Alpha within [0, 1], and no colour brighter than the brightest Gaussian or background."""
    picture = render(random_scene(seed, count), views(), torch.ones(3))
    assert picture.alpha.min() >= 0 and picture.alpha.max() <= 1
    assert picture.rgb.min() >= 0 and picture.rgb.max() <= 1 + 1e-5


def test_depth_lies_between_the_nearest_and_the_farthest():
    gaussians = random_scene(3)
    picture = render(gaussians, views())
    for camera, depth, alpha in zip(views(), picture.depth, picture.alpha, strict=True):
        _, depths = camera.project(gaussians.means.numpy())
        seen = depth[alpha > 0]
        assert seen.min() >= depths.min() - 1e-4 and seen.max() <= depths.max() + 1e-4
        assert not depth[alpha == 0].any()


@pytest.mark.parametrize("broken", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "colors", "sh"])
def test_what_is_not_finite_is_not_drawn(name, broken):
    sound = random_scene(1, coefficients=4 if name == "sh" else 0)
    bad = sound[:7].map(torch.clone)
    getattr(bad, name).view(7, -1)[:, -1] = broken
    both = cat([bad, sound]).map(lambda t: t.clone().requires_grad_())
    picture = render(both, views())
    assert torch.equal(picture.rgb, render(sound, views()).rgb)
    assert not picture.info.visible[:, :7].any()
    (picture.rgb.square().sum() + picture.depth.sum()).backward()
    for value in (v for v in vars(both).values() if v is not None):
        assert not value.grad[:7].any() and value.grad.isfinite().all() and value.grad.any()


def test_a_quaternion_of_length_zero_is_not_drawn():
    gaussians = random_scene(2)
    gaussians.quats[:] = 0
    assert not render(gaussians, views()).alpha.any()


@pytest.mark.parametrize("huge", [1e6, 1e18, 1e30])
def test_huge_numbers_give_finite_pictures(huge):
    for name in ("means", "scales"):
        gaussians = random_scene(4).map(torch.clone)
        getattr(gaussians, name)[::2] *= huge
        leaves = gaussians.map(lambda t: t.requires_grad_())
        picture = render(leaves, views())
        assert picture.rgb.isfinite().all() and picture.alpha.max() <= 1


@pytest.mark.parametrize(("width", "height"), [(0, 0), (0, 5), (5, 0), (1, 1)])
def test_pictures_without_pixels(width, height):
    camera = Camera(width, height, camera_at((0, 0, 1.0)).intrinsics, np.eye(4))
    gaussians = random_scene(5).map(lambda t: t.requires_grad_())
    picture = render(gaussians, [camera], torch.ones(3))
    assert picture.rgb.shape == (1, height, width, 3)
    (picture.rgb.sum() + picture.depth.sum()).backward()
    assert gaussians.means.grad.isfinite().all()


@pytest.mark.parametrize("precision", [torch.float16, torch.bfloat16])
def test_half_precision_parameters_get_gradients_of_their_kind(precision):
    start = random_scene(6)
    half = start.map(lambda t: t.to(precision).requires_grad_())
    rounded = half.map(lambda t: t.detach().float().requires_grad_())
    for gaussians in (half, rounded):
        render(gaussians, views()).rgb.square().mean().backward()
    for a, b in zip(vars(half).values(), vars(rounded).values(), strict=True):
        if a is not None:
            assert a.grad.dtype == precision
            assert torch.equal(a.grad, b.grad.to(precision))


def test_many_cameras_in_one_call_equal_as_many_calls():
    gaussians, cameras = random_scene(8), views() * 3
    backgrounds = torch.rand(6, 30, 44, 3, generator=torch.Generator().manual_seed(0))
    together = render(gaussians, cameras, backgrounds).rgb
    for i, camera in enumerate(cameras):
        assert torch.equal(together[i], render(gaussians, [camera], backgrounds[i]).rgb[0])


def test_poses_can_be_learnt():
    """The use of pose gradients: a camera that is off finds back by the picture alone."""
    gaussians, [camera, _] = random_scene(9, count=150), views()
    target = render(gaussians, [camera]).rgb
    correction = torch.tensor([0.01, -0.015, 0.01, 0.01, 0.005, -0.01], requires_grad=True)
    optimiser = torch.optim.Adam([correction], lr=1e-3)
    losses = []
    pose = torch.from_numpy(camera.world_to_camera).float()
    for _ in range(80):
        x, y, z, *shift = correction
        zero = torch.zeros(())
        skew = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).view(3, 3)
        change = torch.cat([torch.linalg.matrix_exp(skew), torch.stack(shift)[:, None]], 1)
        moved = torch.cat([change, torch.tensor([[0.0, 0, 0, 1]])]) @ pose
        loss = (render(gaussians, [camera], world_to_camera=moved[None]).rgb - target).abs().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(float(loss.detach()))
    assert min(losses) < 0.1 * losses[0]  # turning and shifting may stand in for one another
