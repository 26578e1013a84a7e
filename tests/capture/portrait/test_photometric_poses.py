"""Poses found by what pictures show."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from ico3d.capture.portrait import photometric_poses
from ico3d.capture.portrait import settings as portrait_settings
from ico3d.capture.portrait.photometric_poses import Look, refine_poses, rigid_motion
from ico3d.common.camera import Camera
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

pytestmark = pytest.mark.slow

SIZE = 48
CAMERA = Camera(SIZE, SIZE, np.array([[90.0, 0, 24], [0, 90, 24], [0, 0, 1]]), np.eye(4))


def _pose(turn_degrees, shift) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("yxz", turn_degrees, degrees=True).as_matrix()
    pose[:3, 3] = np.array([0, 0, 0.6]) + shift
    return pose


def _head(random) -> Gaussians:
    """A coloured ball of 12 cm."""
    points = random.normal(size=(700, 3))
    points *= 0.06 / np.linalg.norm(points, axis=1, keepdims=True)
    blotches = np.sin(points @ random.normal(size=(3, 3)) * 60) / 2 + 0.5
    return Gaussians(
        torch.from_numpy(points).float(),
        torch.tensor([[1.0, 0, 0, 0]]).repeat(700, 1),
        torch.full((700, 3), 0.005),
        torch.full((700,), 0.95),
        torch.from_numpy(blotches).float(),
    )


def test_a_rigid_motion_is_rotation_vector_and_shift():
    correction = torch.tensor([0.1, -0.2, 0.3, 0.6, 0.0, -1.2], dtype=torch.float64)
    expected = np.eye(4)
    expected[:3, :3] = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    expected[:3, 3] = [0.1, 0.0, -0.2]
    np.testing.assert_allclose(rigid_motion(correction).numpy(), expected, atol=1e-12)


def test_wrong_poses_are_put_right(monkeypatch):
    monkeypatch.setattr(photometric_poses, "COUNT", 700)
    monkeypatch.setattr(portrait_settings, "STEPS", (450, 450))
    random = np.random.default_rng(0)
    head = _head(random)
    true = [_pose(random.uniform(-12, 12, 3), random.normal(0, 0.004, 3)) for _ in range(12)]
    images = [render(head, [CAMERA.moved(pose)]).rgb[0].numpy() for pose in true]
    looks = [Look(image, np.ones((SIZE, SIZE), np.float32)) for image in images]
    errors = random.normal(size=(12, 6)) * [*[0.03] * 3, *[0.002 * 6] * 3]
    errors -= errors.mean(0)
    wrong = [
        p @ rigid_motion(torch.from_numpy(e)).numpy() for p, e in zip(true, errors, strict=True)
    ]
    background = np.zeros((SIZE, SIZE, 3), np.float32)
    found = refine_poses(np.stack(wrong), head.means.numpy(), CAMERA, background, looks.__getitem__)

    def apart(poses) -> float:
        """Mean angle in degrees between the turns from pose to pose and the true ones."""
        turns = [Rotation.from_matrix(p[:3, :3]) for p in poses]
        truth = [Rotation.from_matrix(p[:3, :3]) for p in true]
        pairs = [
            (turns[0].inv() * a) * (truth[0].inv() * b).inv()
            for a, b in zip(turns[1:], truth[1:], strict=True)
        ]
        return float(np.degrees(np.mean([pair.magnitude() for pair in pairs])))

    assert apart(wrong) > 2.5
    assert apart(found.poses) < 0.35 * apart(wrong)
    assert 1.0 < found.turn < 5.0 and 0.0005 < found.shift < 0.01
    for pose in found.poses:
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-6)
