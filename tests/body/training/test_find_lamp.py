"""Where the light comes from, by colours that change as a body moves."""

import math

import numpy as np
import pytest
import torch
from torch.nn.functional import normalize

from ico3d.body.planning.windows import Window
from ico3d.body.skinning.casters import caster_tensors, spread_casters
from ico3d.body.skinning.light import lamp_lit, lit
from ico3d.body.skinning.shadow import reached
from ico3d.body.training.find_lamp import Seen, find_lighting, regressed
from ico3d.rig.shadow_map import RADIUS
from support.bodies.moving_capture import FRAMES
from support.bodies.tracked_capture import TrackedCapture

LAMP = normalize(torch.tensor([-0.5, 0.6, 0.7]), dim=0)
STRENGTH = torch.tensor([0.3, 0.0, -0.4])


def turning(moments: int = 6, count: int = 300, unseen: float = 0.2) -> tuple[Seen, torch.Tensor]:
    """Points on a ball that turns under a lamp, behind a bar; some are not seen at times."""
    generator = torch.Generator().manual_seed(0)

    def random(*shape):
        return torch.randn(*shape, generator=generator)

    rest, albedo, light = normalize(random(count, 3), dim=1), 0.7 * random(count, 3), random(8, 3)
    angles = torch.linspace(0, 2.5, moments)
    turns = [
        torch.linalg.matrix_exp(a * torch.tensor([[0, -0.3, 1.0], [0.3, 0, 0.5], [-1, -0.5, 0]]))
        for a in angles
    ]
    normals = torch.stack([rest @ turn.T for turn in turns])  # (T, P, 3)
    along = torch.arange(-0.6, 0.6, RADIUS)
    bar = torch.cat([torch.stack([along, 0 * along + y, 0 * along + 0.3], 1) for y in (0.2, 0.22)])
    points = 0.25 * normals

    def reach(direction: torch.Tensor) -> torch.Tensor:
        both = zip(points, normals, strict=True)
        return torch.stack([reached(p, n, bar, direction) for p, n in both])

    flat, share = normals.flatten(0, 1), reach(LAMP).flatten()
    added = lit(flat, 0.2 * light) + lamp_lit(flat, share, LAMP, STRENGTH)
    colors = (albedo + added.unflatten(0, (moments, count))).sigmoid()
    colors[torch.rand(moments, count, generator=generator) < unseen] = math.nan
    return Seen(colors, normals, reach), 0.2 * light


def test_a_lamp_is_found_by_its_shadow():
    seen, light = turning()
    found = regressed(seen)
    assert math.degrees(math.acos(min(float(found.direction @ LAMP), 1))) < 3
    torch.testing.assert_close(found.strength, STRENGTH, atol=0.2, rtol=0)
    added, expected = (lit(seen.normals.flatten(0, 1), part) for part in (found.light, light))
    moved = [part.unflatten(0, (6, 300)) for part in (added, expected)]
    moved = [part - part.mean(0) for part in moved]  # each point has a colour of its own
    assert (moved[0] - moved[1]).square().mean() < 0.01 * moved[1].square().mean()


def test_without_pictures_there_is_some_light_all_the_same():
    """Nothing is seen: finite numbers, which training takes from there."""
    seen, _ = turning(moments=2, count=20, unseen=1.1)
    found = regressed(seen)
    for part in (found.light, found.direction, found.strength):
        assert part.isfinite().all()


def test_a_capture_tells_its_light(tmp_path):
    """From pictures, masks and the track; the figure is one colour, lit evenly: a weak lamp."""
    capture = TrackedCapture(tmp_path)
    track = capture.body_track()
    assert track is not None
    casters = caster_tensors(spread_casters(track))
    found = find_lighting(capture, track, Window(0, FRAMES - 1), casters)
    assert float(found.direction.norm()) == pytest.approx(1, abs=1e-4)
    assert found.light.isfinite().all() and found.light.shape == (8, 3)


def test_spheres_lie_under_the_skin_and_cover_it(tmp_path):
    track = TrackedCapture(tmp_path).body_track()
    assert track is not None
    casters = spread_casters(track)
    corners = track.vertices[track.faces].astype(float)
    middles = corners.mean(1)
    away = np.linalg.norm(middles[:, None] - casters.points[None], axis=2).min(1)
    assert away.max() < 2.2 * RADIUS
    skin = casters.points + RADIUS * casters.normals
    between = np.linalg.norm(skin[:, None] - skin[None], axis=2)
    assert between[~np.eye(len(skin), dtype=bool)].min() >= RADIUS
