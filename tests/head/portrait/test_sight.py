"""Gaussians of a head that is seen from one side: together along the line of sight, never long."""

import math

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from ico3d.common.camera import Camera
from ico3d.head.portrait.sight import CELL, SHORTEST, Sight, shared, sight_of
from ico3d.head.views import View


def seen_from(*angles: float) -> list[View]:
    """Views of the origin from half a metre away, turned about the vertical by degrees."""
    views = []
    for angle in angles:
        about = Rotation.from_euler("y", angle, degrees=True).as_matrix()  # camera to world
        world_to_camera = np.eye(4)
        world_to_camera[:3, :3] = np.diag([1.0, -1.0, -1.0]) @ about.T
        world_to_camera[2, 3] = 0.5
        views.append(View(0, 0, Camera(8, 8, np.eye(3), world_to_camera, "0")))
    return views


def test_the_line_of_sight_is_the_mean_direction_of_a_frontal_recording():
    sight = sight_of(seen_from(-8, 0, 8))
    assert sight is not None
    assert torch.allclose(sight.axes[2], torch.tensor([0.0, 0.0, 1.0]), atol=1e-6)
    assert torch.allclose(sight.axes @ sight.axes.T, torch.eye(3), atol=1e-6)
    turned = sight_of(seen_from(20, 30, 40))
    assert turned is not None
    assert math.degrees(math.atan2(*turned.axes[2, [0, 2]].tolist())) == pytest.approx(30)


def test_a_head_that_is_seen_from_several_sides_has_no_line_of_sight():
    assert sight_of(seen_from(-30, -15, 0, 15, 30)) is None
    assert sight_of(seen_from(0, 90, 180, 270)) is None


def test_neighbours_step_together_along_the_line_of_sight_and_freely_across_it():
    sight = sight_of(seen_from(0))
    assert sight is not None
    before = torch.tensor([[0.0, 0, 0], [0.0015, 0, 0], [0.1, 0, 0]])
    steps = torch.tensor([[0.001, 0.002, 0.003], [-0.001, 0, -0.001], [0, 0.001, 0.007]])
    moved = sight.together(before + steps, before) - before
    assert torch.allclose(moved[:, :2], steps[:, :2], atol=1e-7)
    assert moved[:, 2].tolist() == pytest.approx([0.001, 0.001, 0.007], abs=1e-7)


def test_what_all_share_stays_and_what_is_far_does_not_count():
    places = torch.rand(500, 2, generator=torch.Generator().manual_seed(0)) * 0.2
    assert torch.allclose(shared(torch.full((500,), 0.3), places), torch.full((500,), 0.3))
    apart = torch.tensor([[0.0, 0.0], [3 * CELL, 0.0], [0.0, 9.0]])  # beyond the blur, and outside
    values = torch.tensor([1.0, 2.0, 4.0])
    assert torch.allclose(shared(values, apart), values)
    near = shared(values, torch.tensor([[0.0, 0.0], [CELL, 0.0], [0.0, 9.0]]))
    assert 1 < near[0] < 1.5 < near[1] < 2 and near[2] == 4


@pytest.mark.parametrize("seed", range(5))
def test_needles_along_the_line_of_sight_become_as_long_as_wide(seed):
    rng = np.random.default_rng(seed)
    turns = Rotation.random(200, rng)
    scales = np.exp(rng.uniform(-8, -4, (200, 3)))
    axes = torch.from_numpy(Rotation.random(rng=rng).as_matrix())
    quats = torch.from_numpy(turns.as_quat(scalar_first=True))
    log_scales = torch.from_numpy(np.log(scales))
    for _ in range(120):
        log_scales = Sight(axes).shortened(log_scales, quats)
    now = log_scales.exp().numpy()
    spread = axes.numpy() @ turns.as_matrix() * now[:, None]  # (200, 3, 3)
    long = np.linalg.norm(spread[:, 2], axis=1)
    wide = np.linalg.svd(spread[:, :2], compute_uv=False)[:, 0]
    assert (long <= 1.01 * wide).all()
    assert (now <= scales * (1 + 1e-9)).all()


def test_discs_that_face_the_cameras_stay_and_nothing_shrinks_at_once():
    scales = torch.tensor([[0.003, 0.002, 0.0005], [0.001, 0.001, 0.1]])
    quats = torch.tensor([[1.0, 0, 0, 0]] * 2)
    found = Sight(torch.eye(3)).shortened(scales.log(), quats).exp()
    assert torch.allclose(found[0], scales[0])
    assert torch.allclose(found[1], torch.tensor([0.001, 0.001, 0.1 * SHORTEST]))
