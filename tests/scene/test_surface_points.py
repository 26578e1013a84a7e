"""Where the Gaussians of a scene begin."""

import numpy as np
import pytest

from ico3d.common.camera import Camera
from ico3d.errors import CaptureError
from ico3d.scene.settings import Density, Initial, SceneSettings
from ico3d.scene.surface_points import initial_scene
from ico3d.scene.views import SceneViews

SETTINGS = SceneSettings(sh_degree=2, initial=Initial(gaussians=100, opacity=0.3))


def _start(capture, only, frames="all", settings=SETTINGS):
    views = SceneViews(capture, only, frames, 1)
    return initial_scene(capture, views, settings, np.random.default_rng(0))


def _means(start):
    return start.scene.parameters["means"].numpy()


def test_a_person_begins_on_its_surface(still):
    start = _start(still(), "person")
    assert len(start.scene) == 100 and start.scene.degree == 2
    np.testing.assert_allclose(np.linalg.norm(_means(start), axis=1), 0.2, atol=1e-6)
    assert start.extent == pytest.approx(0.2, rel=0.05)
    assert start.scene.gaussians().opacities.allclose(
        start.scene.gaussians().opacities[:1] * 0 + 0.3
    )


def test_without_surface_points_a_person_begins_on_the_hull_of_its_masks(still, monkeypatch):
    capture = still(6)
    monkeypatch.setattr(type(capture), "head_points", lambda _: None)
    means = _means(_start(capture, "person"))
    from_middle = np.linalg.norm(means, axis=1)
    # the hull bulges towards the middle of the arc; across it, it is as tall as the ball's edge
    assert from_middle.max() < 0.5 and 0.2 < np.abs(means[:, 1]).max() < 0.31
    assert np.linalg.norm(means.mean(0)) < 0.08


def test_surface_points_follow_the_head_into_the_world(still):
    capture = still(2, 3)
    means = _means(_start(capture, "all", 2))
    on_shell = np.abs(np.linalg.norm(means - [0.2, 0, 0], axis=1) - 0.2) < 1e-6
    assert on_shell.sum() == 50


def test_surface_points_of_a_body_are_in_the_world_already(still, monkeypatch):
    """Its head may move; the points stay where they are."""
    capture = still(2, 3)
    shell = type(capture).head_points(capture)
    monkeypatch.setattr(type(capture), "head_points", lambda _: None)
    monkeypatch.setattr(type(capture), "world_points", lambda _, frame=0: shell)
    means = _means(_start(capture, "all", 2))
    assert (np.abs(np.linalg.norm(means, axis=1) - 0.2) < 1e-6).sum() == 50


def test_a_background_begins_before_the_cameras_in_their_pictures(still):
    capture = still(2)
    start = _start(capture, "background")
    pictures = [camera.project(_means(start).astype(float)) for camera in capture.cameras]
    inside = [(p > -1e-3).all(1) & (p < 32.001).all(1) & (z > 0) for p, z in pictures]
    assert np.logical_or(*inside).all() and all(50 > (~i).sum() > 0 for i in inside)
    distance = np.linalg.norm(capture.cameras[0].camera_to_world[:3, 3])
    depths = np.maximum(*(z for _, z in pictures))
    assert depths.min() > 0.45 * distance and 3 * distance < depths.max() < 6.1 * distance
    assert start.extent == pytest.approx(1.1 * np.sin(0.8), rel=1e-6)


def test_colours_are_those_of_the_pictures(still):
    start = _start(still(), "background")
    colors = start.scene.gaussians(0).sh[:, 0] * 0.28209479177387814 + 0.5
    # one to two plates of 0.25 averaged with the grey that everything begins with
    assert ((colors > 0.32) & (colors < 0.39)).all()


def test_never_more_than_the_cap(still):
    few = SceneSettings(initial=Initial(gaussians=90), density=Density(max_gaussians=40))
    start = _start(still(), "all", settings=few)
    assert len(start.scene) == 40


def test_what_cannot_be_placed_is_one_sentence(still, monkeypatch):
    capture = still(3)
    with monkeypatch.context() as patch:
        patch.setattr(type(capture), "head_points", lambda _: None)
        patch.setattr(type(capture), "mask", lambda *_: np.zeros((32, 32), np.float32))
        with pytest.raises(CaptureError, match="agree on no place"):
            _start(capture, "person")
        one = capture.cameras[0]
        beside = np.eye(4)
        beside[0, 3] = 0.1
        turned = Camera(32, 32, one.intrinsics, beside @ one.world_to_camera, "1")
        capture.cameras = (one, turned)
        with pytest.raises(CaptureError, match="cannot be placed in depth"):
            _start(capture, "person")
    capture.cameras = (one, one)
    with pytest.raises(CaptureError, match="taken from one place"):
        _start(capture, "background")
