"""Cameras between the recorded ones for temporal fine-tuning."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm
from scipy.spatial.transform import RigidTransform

from ico3d.body.training.novel_views import mean_pose, novel_camera, se3_exp, se3_log
from ico3d.common.camera import Camera, look_at

MIDDLE = np.array([0.2, 1.0, -0.3])
twists = arrays(np.float64, (3, 6), elements=st.floats(-1.7, 1.7))


def _on_ring(turn, height=0.0, name="0", size=(200, 300), focal=400.0):
    eye = MIDDLE + np.array([3 * np.sin(turn), height, 3 * np.cos(turn)])
    intrinsics = np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1]])
    return Camera(*size, intrinsics, look_at(eye, MIDDLE), name)


def _ring(count, heights=(0.0,)):
    turns = np.arange(count) * 2 * np.pi / count
    return [_on_ring(turn, height) for height in heights for turn in turns]


def _some_poses(seed, count=3):
    """Poses turned by less than half a turn against one another."""
    rng = np.random.default_rng(seed)
    return se3_exp(rng.uniform(-0.8, 0.8, (count, 6)))


@given(twists)
def test_exp_is_the_matrix_exponential_and_log_its_inverse(values):
    transforms = se3_exp(values)
    for twist, transform in zip(values, transforms, strict=True):
        x, y, z = twist[:3]
        matrix = np.zeros((4, 4))
        matrix[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        matrix[:3, 3] = twist[3:]
        np.testing.assert_allclose(transform, expm(matrix), atol=1e-12)
    np.testing.assert_allclose(se3_log(transforms), values, atol=1e-9)


def test_exp_and_log_are_batched_float64():
    values = np.random.default_rng(0).uniform(-1, 1, (2, 5, 6))
    transforms = se3_exp(values)
    assert transforms.shape == (2, 5, 4, 4) and transforms.dtype == np.float64
    np.testing.assert_array_equal(transforms[1, 3], se3_exp(values[1, 3]))
    np.testing.assert_allclose(se3_log(transforms), values, atol=1e-12)
    np.testing.assert_array_equal(se3_exp(np.zeros(6)), np.eye(4))
    # near half a turn the axis is still found
    turn = np.array([0, np.pi - 1e-6, 0, 0.3, -0.2, 0.1])
    np.testing.assert_allclose(se3_log(se3_exp(turn)), turn, atol=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_a_single_weight_returns_its_pose(seed):
    poses = _some_poses(seed)
    for index in range(3):
        np.testing.assert_allclose(mean_pose(poses, np.eye(3)[index]), poses[index], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_mean_moves_with_the_world_and_ignores_order(seed):
    poses, rng = _some_poses(seed), np.random.default_rng(seed)
    weights = rng.dirichlet(np.ones(3))
    mean = mean_pose(poses, weights)
    world = RigidTransform.from_exp_coords(rng.uniform(-3, 3, 6)).as_matrix()
    np.testing.assert_allclose(mean_pose(world @ poses, weights), world @ mean, atol=1e-9)
    order = [2, 0, 1]
    np.testing.assert_allclose(mean_pose(poses[order], weights[order]), mean, atol=1e-9)
    # what defines it
    np.testing.assert_allclose(weights @ se3_log(np.linalg.inv(mean) @ poses), 0, atol=1e-11)


def test_the_mean_of_two_is_halfway_on_the_screw_between_them():
    first, second = _on_ring(0.0), _on_ring(1.2)
    poses = np.stack([first.camera_to_world, second.camera_to_world])
    between = mean_pose(poses, np.array([0.5, 0.5]))
    np.testing.assert_allclose(between, _on_ring(0.6).camera_to_world, atol=1e-9)


@pytest.mark.parametrize("cameras", [_ring(48), _ring(16, (-0.6, 0.0, 0.8))], ids=["48", "3x16"])
def test_nearly_all_are_usable_on_a_ring_of_48(cameras):
    rng = np.random.default_rng(0)
    usable = 0
    distances = [np.linalg.norm(c.camera_to_world[:3, 3] - MIDDLE) for c in cameras]
    for _ in range(300):
        camera = novel_camera(cameras, rng)
        away = np.linalg.norm(camera.camera_to_world[:3, 3] - MIDDLE)
        pixel, depth = camera.project(MIDDLE)
        off = np.linalg.norm(pixel - [100, 150])
        near = min(distances) * 0.97 < away < max(distances) * 1.03
        usable += near and depth > 0 and off < 10
    assert usable >= 297


def test_it_is_random_and_repeats_with_the_seed():
    cameras = _ring(8)
    first, second = (novel_camera(cameras, np.random.default_rng(seed)) for seed in (1, 2))
    again = novel_camera(cameras, np.random.default_rng(1))
    np.testing.assert_array_equal(first.world_to_camera, again.world_to_camera)
    assert np.abs(first.world_to_camera - second.world_to_camera).max() > 0.01
    recorded = np.stack([camera.world_to_camera for camera in cameras])
    assert np.abs(recorded - first.world_to_camera).max((1, 2)).min() > 1e-3


def test_lenses_lie_between_those_of_the_cameras():
    wide = _on_ring(0.0, size=(200, 300), focal=200.0)
    tele = _on_ring(0.3, size=(400, 600), focal=1600.0)  # four times as long for its picture
    rng = np.random.default_rng(0)
    found = [novel_camera([wide, tele], rng) for _ in range(40)]
    for camera in found:
        scale = camera.width / 200
        assert (camera.width, camera.height) in {(200, 300), (400, 600)}
        assert 200 * scale < camera.intrinsics[0, 0] < 800 * scale
        assert camera.intrinsics[0, 0] == pytest.approx(camera.intrinsics[1, 1])
        np.testing.assert_allclose(camera.intrinsics[:2, 2], [100 * scale, 150 * scale])
        # the same weights mix poses and, geometrically, lenses
        turn = np.arctan2(*(camera.camera_to_world[:3, 3] - MIDDLE)[[0, 2]])
        share = np.log(camera.intrinsics[0, 0] / (200 * scale)) / np.log(4)
        assert turn == pytest.approx(0.3 * share, abs=1e-6)
    assert len({camera.width for camera in found}) == 2


def test_cropped_pictures_keep_their_principal_point():
    cameras = [camera.cropped(30, -10, 120, 250) for camera in _ring(12)]
    camera = novel_camera(cameras, np.random.default_rng(0))
    assert (camera.width, camera.height) == (120, 250)
    # the weights have sum 1
    np.testing.assert_allclose(camera.intrinsics, cameras[0].intrinsics, atol=1e-9)


def test_cameras_that_look_at_one_another_are_not_mixed():
    rng = np.random.default_rng(0)
    opposite = _ring(2)
    for _ in range(10):
        pose = novel_camera(opposite, rng).world_to_camera
        assert min(np.abs(pose - c.world_to_camera).max() for c in opposite) < 1e-12
    for _ in range(30):  # of four around, never two that are opposite
        away = np.linalg.norm(novel_camera(_ring(4), rng).camera_to_world[:3, 3] - MIDDLE)
        assert 2.9 < away < 3.1


def test_a_single_camera_is_its_own_neighbour():
    camera = _on_ring(0.7)
    found = novel_camera([camera], np.random.default_rng(0))
    np.testing.assert_allclose(found.world_to_camera, camera.world_to_camera, atol=1e-12)
    np.testing.assert_allclose(found.intrinsics, camera.intrinsics, atol=1e-12)
