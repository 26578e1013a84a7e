"""The shadow that spheres cast in the light of a distant lamp."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn.functional import normalize

from ico3d.body.skinning.light import lamp_lit
from ico3d.body.skinning.shadow import posed_casters, reached
from ico3d.rig.shadow_map import BIAS, RADIUS, SIDE, TEXEL

UP = torch.tensor([0.0, 1.0, 0.0])
FRONT = torch.tensor([0.0, 0.0, 1.0])


def wall(at: float) -> torch.Tensor:
    """(M, 3) spheres side by side, half a metre wide, in the plane z = at."""
    steps = torch.arange(-0.25, 0.25, RADIUS)
    x, y = torch.meshgrid(steps, steps, indexing="xy")
    return torch.stack([x.flatten(), y.flatten(), torch.full((x.numel(),), at)], 1)


@pytest.mark.parametrize("kind", [torch.float32, torch.float64])
def test_what_stands_before_a_point_takes_its_light(kind):
    """Before it, beside it, behind it, so near that it is the skin itself, and 3.2 m away."""
    points = torch.tensor([[0, 0, 0], [0.4, 0, 0], [0, 0, 1], [0, 0, 0.5], [0, SIDE * TEXEL, 0]])
    points = points.to(kind)
    casters = torch.cat([wall(0.5), wall(-0.5)]).to(kind)
    found = reached(points, FRONT.to(kind).expand(5, 3), casters, FRONT.to(kind))
    assert found.tolist() == [0, 1, 1, 1, 0]


def test_the_edge_of_a_shadow_is_soft():
    """It fades over four texels, and half the light is left where the wall ends."""
    end = float(wall(0.5)[:, 0].max()) + RADIUS
    x = torch.linspace(end - 0.06, end + 0.06, 49)
    points = torch.stack([x, torch.zeros(49), torch.zeros(49)], 1)
    found = reached(points, FRONT.expand(49, 3), wall(0.5), FRONT)
    assert found[0] == 0 and found[-1] == 1
    assert (found.diff() >= -1e-6).all() and found.diff().max() < 0.15
    half = x[(found - 0.5).abs().argmin()].item()
    assert half == pytest.approx(end, abs=TEXEL)


@settings(max_examples=20)
@given(st.integers(0, 1000))
def test_the_kernels_do_what_torch_does(seed):
    """In any direction, on both sides of where the map repeats."""
    generator = torch.Generator().manual_seed(seed)
    casters = 0.3 * torch.randn(300, 3, generator=generator) + SIDE * TEXEL / 2
    points = 0.3 * torch.randn(200, 3, generator=generator) + SIDE * TEXEL / 2
    normals = normalize(torch.randn(200, 3, generator=generator), dim=1)
    direction = normalize(torch.randn(3, generator=generator), dim=0)
    fast = reached(points, normals, casters, direction)
    slow = reached(*(part.double() for part in (points, normals, casters, direction)))
    assert (fast - slow).abs().max() < 0.02 and 0.02 < slow.mean() < 0.98


def test_spheres_go_with_their_joints():
    """One hangs on a joint that is turned by a quarter and moved, one half on that."""
    table = torch.zeros(2, 16)
    table[0, [0, 4, 8]] = 1
    table[1, [1, 3, 8, 9]] = torch.tensor([-1.0, 1.0, 1.0, 0.5])
    joints = torch.tensor([[1, 0, 0, 0], [1, 0, 0, 0]], dtype=torch.int32)
    weights = torch.tensor([[1.0, 0, 0, 0], [0.5, 0.5, 0, 0]])
    found = posed_casters(table, torch.tensor([[1.0, 0, 2], [1.0, 0, 2]]), joints, weights)
    torch.testing.assert_close(found, torch.tensor([[0.5, 1, 2], [0.75, 0.5, 2]]))


def test_a_lamp_lights_what_faces_it_and_stands_free():
    """Straight on by log(1 + strength); half in shadow less; what looks away is not lit."""
    normals = torch.stack([UP, UP, -UP, FRONT])
    reach = torch.tensor([1.0, 0.5, 1.0, 1.0])
    strength = torch.tensor([0.0, 1.0, -1.0])
    found = lamp_lit(normals, reach, UP, strength)
    for row, much in zip(found, (1.2, 0.6, 0.0, 0.2), strict=True):
        expected = [math.log1p(much * math.exp(k)) for k in strength.tolist()]
        assert row.tolist() == pytest.approx(expected, abs=1e-6)
    assert BIAS > RADIUS  # or spheres that touch the skin from within would shade it


def test_gradients_of_the_lamp():
    """By finite differences: of its strength, and of where surfaces face."""
    generator = torch.Generator().manual_seed(1)
    normals = normalize(torch.randn(6, 3, generator=generator, dtype=torch.float64), dim=1)
    normals = normals[(normals[:, 1] + 0.2).abs() > 0.05].requires_grad_()
    reach = torch.rand(len(normals), generator=generator, dtype=torch.float64)
    strength = torch.randn(3, generator=generator, dtype=torch.float64).requires_grad_()
    up = UP.double()
    assert torch.autograd.gradcheck(lambda n, s: lamp_lit(n, reach, up, s), (normals, strength))
