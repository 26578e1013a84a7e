"""Both backends against the float64 reference."""

import sys

import numpy as np
import pytest
import torch

from ico3d.errors import MissingExtraError
from ico3d.splat import cuda
from ico3d.splat.cpu.forward import power_of_two
from ico3d.splat.cpu.rasterise import Project, bin_views, camera_numbers
from ico3d.splat.cpu.tiles import TILE_HEIGHT, unpack_rows
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from support.splats import reference
from support.splats.reference import camera_at

pytestmark = pytest.mark.slow

PARAMETERS = ("means", "quats", "scales", "opacities", "colors")
DEVICES = [
    "cpu",
    pytest.param(
        "cuda",
        marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device here"),
    ),
]


def leaves(gaussians, dtype, device="cpu"):
    """A copy in which every parameter collects a gradient."""
    return gaussians.map(lambda t: t.detach().to(device, dtype).requires_grad_())


def weights_for(tensor, seed):
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(tensor.shape, generator=generator, dtype=torch.float64).to(tensor)


def loss_of(rgb, alpha, depth):
    """A loss that weighs every output of every pixel differently."""
    parts = [(t * weights_for(t, k)).sum() for k, t in enumerate((rgb, alpha, depth))]
    return parts[0] + parts[1] + 0.3 * parts[2]


def difference(a, b):
    """Largest difference relative to the largest value."""
    return float((a.detach().cpu() - b.detach()).abs().max() / b.detach().abs().max())


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("antialiased", [True, False])
@pytest.mark.parametrize(
    ("count", "seed", "spread", "coefficients"),
    [(60, 0, 0.35, 0), (80, 1, 1.0, 1), (200, 2, 0.2, 4), (50, 3, 0.3, 9), (60, 4, 0.3, 16)],
)
def test_values_and_gradients(cameras, device, count, seed, spread, coefficients, antialiased):
    start = reference.harmonic(reference.scene(count, seed, spread), coefficients)
    exact, ours = leaves(start, torch.float64), leaves(start, torch.float32, device)
    poses = torch.from_numpy(np.stack([camera.world_to_camera for camera in cameras]))
    exact_poses, our_poses = poses.clone().requires_grad_(), poses.to(device).requires_grad_()
    background = torch.rand(2, 30, 44, 3, generator=torch.Generator().manual_seed(5))
    options = {"antialiased": antialiased}
    wanted = reference.render(exact, cameras, background.double(), exact_poses, **options)
    picture = render(ours, cameras, background.to(device), world_to_camera=our_poses, **options)
    got = (picture.rgb, picture.alpha, picture.depth)
    for a, b in zip(got, wanted, strict=True):
        assert difference(a, b) < 1e-4
    loss_of(*wanted).backward()
    loss_of(*got).backward()
    bound = 1e-4 if device == "cpu" else 1e-3
    for name, value in vars(exact).items():
        if value is not None:
            assert difference(getattr(ours, name).grad, value.grad) < bound, name
    assert difference(our_poses.grad, exact_poses.grad) < bound


@pytest.mark.parametrize("device", DEVICES)
def test_screen_gradients_are_those_of_normalised_coordinates(cameras, device):
    start = reference.scene(50, 4)
    exact, ours = leaves(start, torch.float64), leaves(start, torch.float32, device)
    picture = render(ours, cameras)
    (picture.rgb * weights_for(picture.rgb, 0)).sum().backward()
    for c, camera in enumerate(cameras):
        means2d, covariances, opacities, depths = reference.project(exact, camera)
        means2d.retain_grad()
        rgb, _ = reference.composite(
            means2d, covariances, opacities, depths, exact.colors, camera.width, camera.height
        )
        (rgb * weights_for(picture.rgb.double().cpu(), 0)[c]).sum().backward()
        norms = (means2d.grad * torch.tensor([camera.width / 2, camera.height / 2])).norm(dim=-1)
        assert difference(picture.info.screen_gradients()[c], norms) < 1e-4
        unseen = ~picture.info.visible[c].cpu()
        assert norms[unseen].abs().max() == 0 if unseen.any() else True


@pytest.mark.parametrize("device", DEVICES)
def test_absolute_gradients_are_sums_over_pixels_without_signs(device):
    camera = camera_at((0.1, 0.2, 1.2), width=9, height=7, focal=11.0)
    start = reference.scene(6, 3, 0.2)
    exact, ours = leaves(start, torch.float64), leaves(start, torch.float32, device)
    picture = render(ours, [camera], absgrad=True)
    weights = weights_for(picture.rgb, 0)
    (picture.rgb * weights).sum().backward()
    means2d, *rest = reference.project(exact, camera)
    means2d.retain_grad()
    rgb, _ = reference.composite(means2d, *rest, exact.colors, camera.width, camera.height)
    pixels = (rgb * weights[0].double().cpu()).sum(-1).flatten()  # (H·W,)
    wanted = sum(
        torch.autograd.grad(pixel, means2d, retain_graph=True)[0].abs() for pixel in pixels
    )
    half = torch.tensor([camera.width / 2, camera.height / 2])
    assert difference(picture.info.screen_gradients()[0], (wanted * half).norm(dim=-1)) < 1e-4
    signed = render(leaves(start, torch.float32, device), [camera]).rgb
    assert torch.equal(signed, picture.rgb)


@pytest.mark.parametrize("device", DEVICES)
def test_nothing_to_draw_leaves_the_background(cameras, device):
    empty = reference.scene(0, dtype=torch.float32).to(device)
    picture = render(empty, cameras, torch.tensor([0.1, 0.2, 0.3], device=device))
    assert picture.rgb.shape == (2, 30, 44, 3)
    assert torch.equal(picture.rgb[1, 7, 9].cpu(), torch.tensor([0.1, 0.2, 0.3]))
    assert not picture.alpha.any() and not picture.depth.any()
    assert picture.info.visible.shape == (2, 0)


@pytest.mark.parametrize("device", DEVICES)
def test_a_background_learns_as_much_as_it_shows(cameras, device):
    gaussians = reference.scene(20, dtype=torch.float32).to(device)
    behind = torch.rand(3, device=device, requires_grad=True)
    picture = render(gaussians, cameras, behind)
    picture.rgb.sum().backward()
    shown = (1 - picture.alpha).sum()
    torch.testing.assert_close(behind.grad, shown.expand(3), rtol=1e-5, atol=0)


@pytest.mark.parametrize("device", DEVICES)
def test_what_lies_behind_is_not_drawn_and_gets_no_gradient(device):
    camera = camera_at((0, 0, 1.0))
    gaussians = reference.scene(20, dtype=torch.float32)
    gaussians.means[:, 2] = torch.linspace(0.995, 3, 20)  # from 5 mm before the camera to behind
    ours = leaves(gaussians, torch.float32, device)
    picture = render(ours, [camera])
    assert not picture.rgb.any() and not picture.info.visible.any()
    picture.rgb.sum().backward()
    for name in PARAMETERS:
        assert not getattr(ours, name).grad.any()


def test_two_runs_give_the_same_bits(cameras):
    def run():
        ours = leaves(reference.scene(300, 7), torch.float32)
        picture = render(ours, cameras)
        (picture.rgb * weights_for(picture.rgb, 1)).sum().backward()
        return [picture.rgb, *(getattr(ours, name).grad for name in PARAMETERS)]

    for a, b in zip(run(), run(), strict=True):
        assert torch.equal(a, b)


def test_an_elongated_splat_loses_no_pixel():
    """Tiles and rows are cut to the ellipse: a long diagonal one must not miss any."""
    camera = camera_at((0, 0, 1.0), width=130, height=100, focal=120.0)
    for angle in np.linspace(0, np.pi, 9):
        turn = [np.cos(angle / 2), 0, 0, np.sin(angle / 2)]
        needle = Gaussians(
            torch.zeros(1, 3),
            torch.tensor([turn]),
            torch.tensor([[0.12, 0.004, 0.004]]),
            torch.tensor([0.99]),
            torch.ones(1, 3),
        ).map(torch.Tensor.double)
        wanted, _, _ = reference.render(needle, [camera])
        assert (render(needle, [camera]).rgb - wanted).abs().max() < 1e-5


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 1e30])
@pytest.mark.parametrize("name", PARAMETERS[:4])
def test_broken_numbers_do_no_harm_to_memory(cameras, name, value):
    """The kernels themselves: `render` hides such Gaussians from them."""
    gaussians = reference.scene(40, dtype=torch.float32)
    getattr(gaussians, name)[::3] = value
    ours = leaves(gaussians, torch.float32)
    picture = render(ours, cameras)
    picture.rgb.sum().backward()
    tiles = bin_views(*broken_projection(ours, cameras), 44, 30)
    for view in tiles:
        (band,) = view.bands()
        owned = [range(*ends) for ends in zip(band.first_pair, band.end_pair, strict=True)]
        splats, rows, pairs = band.entries.T
        found = sorted(zip(pairs, splats, strict=True))
        listed = zip(owned, view.order, strict=True)
        assert found == [(pair, splat) for own, splat in listed for pair in own]
        assert band.first_entry[-1] == len(pairs) <= band.room
        spans = [unpack_rows(packed) for packed in rows]
        assert all(0 <= first < end <= TILE_HEIGHT for first, end in spans)


def test_powers_of_two_are_right_to_a_millionth():
    exponents = np.linspace(-8, 0, 999, dtype=np.float32)
    found = np.array([power_of_two(exponent) for exponent in exponents])
    np.testing.assert_allclose(found, np.exp2(exponents.astype(np.float64)), rtol=1e-6)


def broken_projection(gaussians, cameras):
    parts = (gaussians.means, gaussians.quats, gaussians.scales, gaussians.opacities)
    poses = torch.from_numpy(np.stack([camera.world_to_camera for camera in cameras]))
    return Project.apply(*parts, camera_numbers(cameras, poses), 44, 30, True)


def test_harmonics_depend_on_the_side(cameras):
    gaussians = reference.scene(30, dtype=torch.float32)
    sh = torch.zeros(30, 4, 3)
    sh[:, 3] = -1  # degree 1, along x: bright when looked at towards +x
    colored = Gaussians(*list(vars(gaussians).values())[:4], sh=sh)
    from_left, from_right = camera_at((-1.2, 0, 0)), camera_at((1.2, 0, 0))
    picture = render(colored, [from_left, from_right])
    assert picture.rgb[0].sum() > 3 * picture.rgb[1].sum()


def test_wrong_shapes_are_refused(cameras):
    gaussians = reference.scene(5, dtype=torch.float32)
    with pytest.raises(ValueError, match="one size"):
        render(gaussians, [cameras[0], camera_at((0, 0, 1), width=50)])
    with pytest.raises(ValueError, match="at least one camera"):
        render(gaussians, [])
    with pytest.raises(ValueError, match="background"):
        render(gaussians, cameras, torch.zeros(44, 30, 3))
    with pytest.raises(ValueError, match="quats"):
        render(Gaussians(gaussians.means, gaussians.scales, *([gaussians.scales] * 3)), cameras)
    with pytest.raises(ValueError, match="colors or sh"):
        render(Gaussians(*list(vars(gaussians).values())[:4]), cameras)


def test_a_missing_gsplat_names_the_extra(monkeypatch, cameras):
    monkeypatch.setitem(sys.modules, "gsplat", None)
    gaussians = reference.scene(3, dtype=torch.float32)
    with pytest.raises(MissingExtraError, match=r"ico3d\[cuda\]"):
        poses = torch.eye(4).expand(2, 4, 4)
        cuda.draw_gaussians(
            gaussians, gaussians.colors.expand(2, 3, 3), cameras, poses, True, False
        )
