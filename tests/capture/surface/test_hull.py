"""The visual hull: what all masks agree on, and what one bad mask must not take away."""

import numpy as np
import pytest

from ico3d.capture.surface import hull as hulls
from ico3d.capture.surface.hull import Silhouette, focus, looked_at, visual_hull
from ico3d.common.camera import Camera, look_at

pytestmark = pytest.mark.slow

CENTER, RADIUS, EDGE = np.array([0.1, 1.0, -0.05]), 0.3, 0.04


def _camera(turn, rise=0.0, distance=2.0):
    eye = CENTER + distance * np.array(
        [np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)]
    )
    intrinsics = np.array([[260.0, 0, 100.0], [0, 250.0, 90.0], [0, 0, 1]])
    return Camera(200, 180, intrinsics, look_at(eye, CENTER))


def _ball(camera):
    """The exact silhouette of the ball: rays that pass its centre within its radius."""
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.stack([columns, rows, np.ones_like(rows)], -1)  # (H, W, 3)
    rays = pixels @ np.linalg.inv(camera.intrinsics).T @ camera.camera_to_world[:3, :3].T
    to_center = CENTER - camera.camera_to_world[:3, 3]
    distance = np.linalg.norm(np.cross(rays, to_center), axis=-1) / np.linalg.norm(rays, axis=-1)
    return (distance < RADIUS).astype(np.float32)


def _ring(count=12):
    return [
        _camera(turn, 0.5 * (-1) ** n) for n, turn in enumerate(np.arange(count) * 6.283 / count)
    ]


def _seen(cameras):
    return [Silhouette.of(camera, _ball(camera)) for camera in cameras]


def _from_center(hull):
    return np.linalg.norm(hull.surface - CENTER, axis=1)


def test_the_hull_of_a_ball_encloses_it_closely():
    hull = visual_hull(_seen(_ring()), EDGE)
    away = _from_center(hull)
    # a pixel is 8 mm wide on the ball
    assert hull.ignored == () and away.min() > RADIUS - 0.012
    assert np.median(away) < RADIUS + 0.02 and away.max() < RADIUS + 0.08
    # a point for each face of the voxels between inside and outside
    assert len(hull.surface) == pytest.approx(6 * np.pi * (RADIUS / EDGE) ** 2, rel=0.25)


@pytest.mark.parametrize("broken", ["empty", "half"])
def test_one_bad_mask_is_found_and_ignored(broken):
    seen = _seen(_ring())
    bad = np.zeros_like(seen[5].mask)
    if broken == "half":
        bad[:90] = seen[5].mask[:90]
    seen[5] = Silhouette(seen[5].camera, bad)
    hull = visual_hull(seen, EDGE)
    away = _from_center(hull)
    assert hull.ignored == (5,)
    assert away.min() > RADIUS - 0.012 and away.max() < RADIUS + 0.1


def test_cropped_pictures_give_the_same_hull():
    cameras = _ring()
    cropped = [camera.cropped(40, 20, 130, 140) for camera in cameras]
    masks = [_ball(camera)[20:160, 40:170] for camera in cameras]
    middle, radius = looked_at(cropped)
    np.testing.assert_allclose(middle, CENTER, atol=0.06)
    assert 0.4 < radius < 0.7
    hull = visual_hull([Silhouette.of(c, m) for c, m in zip(cropped, masks, strict=True)], EDGE)
    away = _from_center(hull)
    assert away.min() > RADIUS - 0.012 and away.max() < RADIUS + 0.08


@pytest.mark.parametrize("count", [3, 4, 6])
def test_nothing_appears_where_only_opposite_cameras_look(count):
    turns = np.arange(count) * 2 * np.pi / count
    narrow = [_camera(turn).cropped(45, 0, 110, 180) for turn in turns]
    seen = [Silhouette.of(camera, _ball(camera)) for camera in narrow]
    away = _from_center(visual_hull(seen, EDGE))
    # three cameras leave a prism about the ball
    assert away.min() > RADIUS - 0.012 and away.max() < 2.2 * RADIUS


def test_large_masks_are_made_smaller_with_their_cameras():
    camera = _camera(0.3)
    large = camera.resized(1000, 900)
    seen = Silhouette.of(large, _ball(large))
    assert seen.mask.shape == (461, 512) and (seen.camera.width, seen.camera.height) == (512, 461)
    np.testing.assert_allclose(seen.mask.mean(), _ball(camera).mean(), rtol=0.01)


def test_masks_that_agree_on_nothing_leave_nothing():
    cameras = _ring(3)
    empty = [Silhouette(camera, np.zeros((180, 200), bool)) for camera in cameras]
    assert visual_hull(empty, EDGE).surface.shape == (0, 3)


def test_there_is_no_hull_without_cameras_that_look_at_one_place():
    one = _camera(0.0)
    beside = np.eye(4)
    beside[0, 3] = 0.1
    parallel = Camera(200, 180, one.intrinsics, beside @ one.world_to_camera)
    assert focus([one, parallel]) is None
    assert visual_hull(_seen([one, parallel]), EDGE) is None
    assert visual_hull(_seen([one]), EDGE) is None
    np.testing.assert_allclose(focus([one, _camera(1.0)]), CENTER, atol=1e-9)


def test_where_cameras_show_a_whole_town_voxels_are_as_large_as_the_memory_allows(monkeypatch):
    monkeypatch.setattr(hulls, "MOST_CELLS", 60)
    away = _from_center(visual_hull(_seen(_ring()), 1e-6))  # 10¹⁸ voxels
    assert away.min() > RADIUS - 0.012 and np.median(away) < RADIUS + 0.02
    monkeypatch.setattr(hulls, "MOST_LOOKS", 12 * 40**3)
    fewer = _from_center(visual_hull(_seen(_ring()), 1e-6))
    assert len(fewer) == pytest.approx((40 / 60) ** 2 * len(away), rel=0.1)


def test_cameras_that_show_more_than_any_number_look_at_no_place():
    far = [_camera(turn) for turn in (0.0, 1.5)]
    wide = np.diag([1e-308, 1e-308, 1.0])
    assert looked_at([Camera(10**6, 10, wide, camera.world_to_camera) for camera in far]) is None


def test_a_lens_that_magnifies_a_million_times_takes_no_more_memory():
    seen = _seen(_ring())
    camera = seen[0].camera
    tele = np.array([[1e9, 0, 100], [0, 1e9, 90], [0, 0, 1]])
    odd = Camera(camera.width, camera.height, tele, camera.world_to_camera)
    hull = visual_hull([*seen[1:], Silhouette(odd, np.ones((180, 200), bool))], EDGE)
    assert hull is not None and _from_center(hull).max() < RADIUS + 0.08
