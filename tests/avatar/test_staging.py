"""Motion, camera and background of a bundle."""

import numpy as np
import pytest

from ico3d.avatar import staging
from ico3d.avatar.render_bundle import visitor_camera
from ico3d.bundle.manifest import CameraInfo


def test_motion_turns_around_where_the_head_is_slow(blendshape_head):
    """10 s at 3 frames/s are 30 frames: from one still moment (20) to the other (50)."""
    _, capture = blendshape_head
    poses = staging.idle_motion(capture).poses
    assert poses.shape == (30, 4, 4)
    first = np.arcsin(poses[0, 0, 2])
    expected = [np.arcsin(capture.world_from_head(f)[0, 2]) for f in range(capture.num_frames)]
    assert abs(np.argmin(np.abs(np.array(expected[:40]) - first)) - 20) <= 2


def test_motion_is_rigid_and_skips_lost_frames(blendshape_head):
    _, capture = blendshape_head
    found = type(capture).world_from_head
    lost = {10: None, 40: np.full((4, 4), np.nan)}
    capture.world_from_head = lambda frame: lost.get(frame, found(capture, frame))
    poses = staging.idle_motion(capture).poses
    assert len(poses) == 29  # frames 11 to 39
    gram = poses[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1)
    np.testing.assert_allclose(gram, np.tile(np.eye(3), (29, 1, 1)), atol=1e-12)
    assert np.array_equal(poses[:, 3], np.tile([0, 0, 0, 1.0], (29, 1)))


def test_without_poses_the_head_rests(blendshape_head):
    _, capture = blendshape_head
    capture.world_from_head = lambda frame: None
    np.testing.assert_array_equal(staging.idle_motion(capture).poses, np.eye(4)[None])


def test_jitter_is_smoothed(blendshape_head):
    _, capture = blendshape_head
    found, rng = type(capture).world_from_head, np.random.default_rng(0)
    jitter = rng.normal(0, 2e-3, (capture.num_frames, 3))

    def shaken(frame):
        pose = found(capture, frame)
        pose[:3, 3] += jitter[frame]
        return pose

    capture.world_from_head = shaken
    assert staging.idle_motion(capture).poses[:, :3, 3].std() < 0.6 * jitter.std()


def test_the_frontal_camera_sees_a_symmetric_face(blendshape_head):
    assert staging.frontal_camera(blendshape_head[1]) == 1


def test_the_visitor_sees_the_whole_person(blendshape_head):
    head, capture = blendshape_head
    points = head.model.means.detach().numpy() + np.array([0.05, -0.04, 0])
    info = staging.visitor_view(capture.cameras[1], points)
    pixels, depths = visitor_camera(info, 200, 200).project(points)
    assert (depths > 0).all()
    assert pixels.min() > 0 and pixels.max() < 200
    assert (np.ptp(pixels, axis=0).max() > 150) and (np.abs(pixels.mean(0) - 100) < 10).all()
    np.testing.assert_allclose(info.eye, (0.0, 0.05, 0.6), atol=1e-5)


def test_the_visitor_never_sees_more_than_was_recorded(blendshape_head):
    _, capture = blendshape_head
    points = np.random.default_rng(0).normal(0, 5, (500, 3))
    info = staging.visitor_view(capture.cameras[1], points)
    assert info.fov_y <= 2 * np.degrees(np.arctan(24 / 70)) + 1e-3


def test_the_visitor_camera_is_the_captures_own_where_it_was_not_moved():
    info = CameraInfo((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 90.0)
    camera = visitor_camera(info, 100, 50)
    np.testing.assert_allclose(camera.project(np.array([0.0, 2.0, 0.0]))[0], (50, 0), atol=1e-9)


def test_backgrounds(blendshape_head):
    _, capture = blendshape_head
    assert staging.background_colour(capture, 0) == pytest.approx((0.3, 0.4, 0.5), abs=2e-5)
    capture.background = lambda camera: None
    assert staging.background_colour(capture, 0) == staging.NEUTRAL
