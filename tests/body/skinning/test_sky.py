"""Light from all around, of which a body hides parts from itself."""

import numpy as np
import pytest
import torch

from ico3d.body.skinning.light import lamp_lit
from ico3d.body.skinning.sky import carried, seen_sky, sky_carriers, turned
from ico3d.rig.shadow_map import RADIUS, SKY_LEAST

UP, OUT = torch.tensor([0.0, 1.0, 0.0]), torch.tensor([0.0, 0.0, 1.0])
DIRECTIONS = 400


def plate(at: torch.Tensor, wide: float) -> torch.Tensor:
    """(M, 3) spheres side by side in a square plane with the normal z."""
    steps = torch.arange(-wide, wide, RADIUS / 2)
    x, y = torch.meshgrid(steps, steps, indexing="xy")
    return at + torch.stack([x.flatten(), y.flatten(), torch.zeros(x.numel())], 1)


def test_a_sphere_alone_sees_all_of_the_sky():
    assert seen_sky(torch.zeros(1, 3), UP[None], 24).tolist() == [1]


def test_a_lid_hides_its_share_of_the_sky():
    """A square above a point hides what its form factor says: here 0.24, 0.55 and 0.80 of it."""
    point = torch.zeros(1, 3)
    for height, wide in ((0.8, 0.4), (0.4, 0.4), (0.2, 0.4)):
        lid = plate(torch.tensor([0, 0, height + RADIUS]), wide)
        casters = torch.cat([point, lid])
        normals = OUT.expand(len(casters), 3)
        seen = float(seen_sky(casters, normals, DIRECTIONS)[0])
        x = wide / height  # the form factor of a square with its middle over a point
        hidden = 4 * x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x)) / np.pi
        assert seen == pytest.approx(1 - hidden, abs=0.05)


def test_the_deepest_fold_is_not_black():
    """Between two plates nothing is seen, and surfaces light each other all the same."""
    casters = torch.cat([plate(torch.zeros(3), 0.5), plate(torch.tensor([0, 0, 0.08]), 0.5)])
    middle = casters[:, :2].norm(dim=1) < 0.1
    normals = torch.where((casters[:, 2] < 0.04)[:, None], OUT, -OUT)
    seen = seen_sky(casters, normals, 48)
    assert seen[middle].max() == pytest.approx(SKY_LEAST)


def test_an_arm_that_is_raised_frees_the_side_below_it():
    """Directions turn with the joints that carry them."""
    table = torch.zeros(2, 16)
    table[0, :9] = torch.eye(3).flatten()
    table[1, :9] = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]).flatten()
    joints = torch.tensor([[0, 1, 0, 0], [1, 0, 0, 0]], dtype=torch.int32)
    weights = torch.tensor([[1.0, 0, 0, 0], [0.5, 0.5, 0, 0]])
    found = turned(table, torch.tensor([[1.0, 0, 0], [1, 0, 0]]), joints, weights)
    torch.testing.assert_close(found, torch.tensor([[1.0, 0, 0], [0.5, 0.5, 0]]))


def test_a_gaussian_sees_what_near_skin_sees_that_faces_alike():
    """A thin hand: the back's sphere is as near, and counts for nothing."""
    facing = torch.stack([OUT, -OUT, OUT])
    casters = {
        "caster_points": torch.tensor([[0, 0, 0.0], [0, 0, 0.001], [0, 0.5, 0]]) - RADIUS * facing,
        "caster_normals": facing,
    }
    found = sky_carriers(np.array([[0.0, 0, 0], [0, 0.49, 0]]), OUT.expand(2, 3).numpy(), casters)
    seen = carried(torch.tensor([0.2, 0.9, 0.6]), found["sky_casters"], found["sky_weights"])
    torch.testing.assert_close(seen, torch.tensor([0.2, 0.6]), atol=1e-3, rtol=0)
    torch.testing.assert_close(found["sky_weights"].sum(1), torch.ones(2))


def test_hidden_sky_takes_light_that_a_lamp_does_not_give():
    """In full shadow colours are multiplied by the sky's share; in light by less than that."""
    normals, strength = OUT.expand(2, 3), torch.zeros(3)
    added = lamp_lit(normals, torch.tensor([0.0, 1.0]), OUT, strength, torch.tensor([0.3, 0.3]))
    torch.testing.assert_close(added[0], torch.full((3,), 0.3).log())
    torch.testing.assert_close(added[1], torch.full((3,), 0.3 + 1.2).log())
