import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.capture.headpose.triangulation import (
    agreeing,
    misses,
    robust,
    sightings,
    triangulate,
)
from ico3d.common.camera import Camera, look_at

LENS = np.array([[900.0, 0, 300], [0, 920, 410], [0, 0, 1]])


def _ring(count, spread=2 * np.pi):
    """Cameras around a head at 1.6 m, of differing distances."""
    cameras = []
    for index in range(count):
        angle, far = spread * index / count, 2.0 + 0.3 * index
        eye = (far * np.sin(angle), 1.5 + 0.1 * index, far * np.cos(angle))
        cameras.append(Camera(600, 800, LENS, look_at(eye, (0, 1.6, 0)), str(index)))
    return cameras


def _face(seed, count=30):
    return np.random.default_rng(seed).normal((0, 1.6, 0), 0.05, (count, 3))


def _seen(cameras, points, noise=None):
    pixels = np.stack([camera.project(points)[0] for camera in cameras])
    return sightings(cameras, pixels if noise is None else pixels + noise)


@settings(max_examples=25)
@given(st.integers(2, 7), st.integers(0, 99))
def test_points_are_exact_whatever_the_weights(count, seed):
    cameras, points = _ring(count), _face(seed)
    if count == 2:
        cameras[1] = _ring(3)[1]  # opposite cameras would leave a line open
    weights = np.random.default_rng(seed).uniform(0.01, 1, (count, len(points)))
    seen = _seen(cameras, points)
    np.testing.assert_allclose(triangulate(seen, weights), points, atol=1e-9)
    assert misses(seen, points).max() < 1e-12


def test_misses_are_metres_across_the_viewing_direction():
    (camera,) = _ring(1)
    point = np.array([[0.01, 1.7, 0.02]])
    right = camera.world_to_camera[0, :3]
    seen = _seen([camera], point)
    assert misses(seen, point + 0.004 * right)[0, 0] == pytest.approx(0.004)
    assert misses(seen, point + 3 * (camera.camera_to_world[:3, 3] - point)) == np.inf


def test_the_mean_of_noisy_cameras_is_weighted():
    """Two cameras of one place that see a point 2 mm apart: it lies where the weights say."""
    aside, front = _ring(4)[1], _ring(4)[0]
    point = np.array([[0.0, 1.6, 0.0]])
    seen = _seen([aside, front, front], point)
    depth = front.project(point)[1][0]
    seen.rays[2, 0, 0] += 0.002 / depth
    found = triangulate(seen, np.array([[1e9], [3.0], [1.0]]))
    assert misses(seen, found)[1:, 0] == pytest.approx([0.0005, 0.0015], rel=1e-3)


@settings(max_examples=15)
@given(st.sets(st.integers(0, 5), max_size=3), st.integers(0, 99))
def test_cameras_that_show_another_face_do_not_agree(wrong, seed):
    random = np.random.default_rng(seed)
    cameras, points = _ring(6), _face(seed)
    pixels = np.stack([c.project(points)[0] for c in cameras]) + random.normal(0, 1, (6, 30, 2))
    for camera in wrong:  # each somewhere else
        pixels[camera] += random.choice([-1, 1], 2) * random.uniform(40, 90, 2)
    expected = [camera not in wrong for camera in range(6)]
    assert agreeing(sightings(cameras, pixels)).tolist() == expected


def test_two_cameras_that_disagree_agree_on_nothing():
    cameras, points = _ring(4)[:2], _face(0)
    pixels = np.stack([camera.project(points)[0] for camera in cameras])
    pixels[1, :, 1] += 60
    assert not agreeing(sightings(cameras, pixels)).any()


def test_cameras_side_by_side_do_not_place_a_face():
    cameras = _ring(2, spread=np.radians(4))
    assert not agreeing(_seen(cameras, _face(0))).any()


def test_a_landmark_that_one_camera_invents_stays_where_the_others_see_it():
    cameras, points = _ring(5), _face(3)
    pixels = np.stack([camera.project(points)[0] for camera in cameras])
    pixels[2, ::3] += (25.0, -15.0)  # 6 cm on every third landmark
    seen = sightings(cameras, pixels)
    ones = np.ones((5, len(points)))
    plain = np.linalg.norm(triangulate(seen, ones) - points, axis=1)
    found, weights = robust(seen, ones)
    away = np.linalg.norm(found - points, axis=1)
    assert plain[::3].min() > 0.005 and away.max() < 3e-4
    assert weights[2, ::3].max() < 0.01 and weights[0].min() > 0.98
