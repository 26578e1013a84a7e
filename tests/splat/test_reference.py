"""The reference itself against finite differences and closed forms."""

import math

import pytest
import torch

from ico3d.splat.gaussians import Gaussians
from support.splats.reference import camera_at, harmonic, render, scene

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("antialiased", [True, False])
@pytest.mark.parametrize("coefficients", [0, 4, 16])
def test_gradients_are_finite_differences(coefficients, antialiased):
    """Of every parameter, the harmonics and the camera's pose."""
    camera = camera_at((0.1, 0.2, 1.2), width=9, height=7, focal=11.0)
    count = 2 if coefficients == 16 else 4  # so many harmonics take long, and are linear
    start = harmonic(scene(count, seed=3, spread=0.2), coefficients)
    names = [name for name, value in vars(start).items() if value is not None]
    values = [getattr(start, name).requires_grad_() for name in names]
    pose = torch.from_numpy(camera.world_to_camera)[None].requires_grad_()
    weights = torch.randn(7, 9, 5, generator=torch.Generator().manual_seed(0)).double()

    def loss(pose, *parts):
        gaussians = Gaussians(**dict(zip(names, parts, strict=True)))
        rgb, alpha, depth = render(gaussians, [camera], None, pose, antialiased)
        return (torch.cat([rgb[0], alpha[0, ..., None], depth[0, ..., None]], -1) * weights).sum()

    assert torch.autograd.gradcheck(loss, [pose, *values], eps=1e-6, atol=1e-5, rtol=1e-4)


def test_one_gaussian_in_closed_form():
    """Seen head on, an isotropic Gaussian has variance (f·s/z)² + 0.3 and dims accordingly."""
    camera = camera_at((0, 0, 2.0), width=21, height=21, focal=50.0)
    u, v = camera.intrinsics[:2, 2]
    center = torch.tensor([[1.0, 2, 3, 4]]).double()
    splat = Gaussians(
        torch.zeros(1, 3).double(),
        center,
        torch.full((1, 3), 0.06, dtype=torch.float64),
        torch.tensor([0.8], dtype=torch.float64),
        torch.tensor([[0.2, 0.5, 1.0]], dtype=torch.float64),
    )
    rgb, alpha, depth = render(splat, [camera], torch.ones(3).double())
    pixel = (50 * 0.06 / 2) ** 2
    pixel_y = (55 * 0.06 / 2) ** 2
    share = math.sqrt(pixel * pixel_y / ((pixel + 0.3) * (pixel_y + 0.3)))
    row, column = 9, 12
    exponent = (column + 0.5 - u) ** 2 / (pixel + 0.3) + (row + 0.5 - v) ** 2 / (pixel_y + 0.3)
    expected = 0.8 * share * math.exp(-0.5 * exponent)
    assert abs(alpha[0, row, column] - expected) < 1e-12
    assert abs(rgb[0, row, column, 1] - (0.5 * expected + 1 - expected)) < 1e-12
    assert abs(depth[0, row, column] - 2) < 1e-12
    assert alpha[0, 0, 0] == 0
