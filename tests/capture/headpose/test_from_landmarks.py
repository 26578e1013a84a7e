"""Head poses from landmarks in space."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ico3d.capture.headpose.from_landmarks import BEHIND, head_from_landmarks
from ico3d.capture.headpose.procrustes import procrustes
from ico3d.capture.headpose.whittaker import LONGEST_GAP
from support.recordings import faces


def test_without_noise_the_motion_is_exact():
    face, poses = faces.face(), faces.motion(40, 15)
    points = faces.moved(poses, face)
    track = head_from_landmarks(points)
    # Canonical head space of this face is its own, but for the origin and the tilt of its nose.
    fixed = np.linalg.inv(poses) @ track.world_from_head
    np.testing.assert_allclose(fixed, np.broadcast_to(fixed[0], fixed.shape), atol=1e-9)
    np.testing.assert_allclose(track.points, points, atol=1e-9)
    for frame in (0, 39):
        pose = track.pose(frame)
        local = (points[frame] - pose[:3, 3]) @ pose[:3, :3]
        np.testing.assert_allclose(local, track.face, atol=1e-9)


def test_canonical_head_space():
    track = head_from_landmarks(faces.moved(faces.motion(10, 15), faces.face()))
    right, left, bridge, under = track.face[[36, 45, 27, 33]]
    np.testing.assert_allclose((left + right) / 2, [0, 0, BEHIND], atol=1e-9)
    np.testing.assert_allclose(left - right, [0.088, 0, 0], atol=1e-9)
    assert bridge[1] - under[1] == pytest.approx(np.hypot(0.052, 0.001), abs=1e-3)
    assert abs(bridge[0]) < 1e-9 and track.face[30, 2] > track.face[27, 2]
    assert np.linalg.det(track.world_from_head[0, :3, :3]) == pytest.approx(1)


@settings(max_examples=10)
@given(st.integers(0, 10_000), st.floats(0, 2.5))
def test_any_turn_is_exact_without_noise(seed, turn):
    poses = faces.motion(12, 15, turn=turn)
    outside = np.eye(4)
    outside[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    track = head_from_landmarks(faces.moved(outside @ poses, faces.face()))
    fixed = np.linalg.inv(outside @ poses) @ track.world_from_head
    np.testing.assert_allclose(fixed, np.broadcast_to(fixed[0], fixed.shape), atol=1e-7)


@pytest.mark.parametrize("millimetres", (1.0, 3.0))
@pytest.mark.parametrize("turn", (0.0, 0.3))
def test_noise_is_bounded_and_smoothing_helps(millimetres, turn):
    random = np.random.default_rng(3)
    poses = faces.motion(150, 15, turn=turn)
    exact = faces.moved(poses, faces.face())
    points = exact + 1e-3 * millimetres * random.normal(size=exact.shape)
    smooth = faces.errors(head_from_landmarks(points).world_from_head, poses)
    held = np.ones(68, bool)
    rough = faces.errors(procrustes(points, held).poses, poses)
    assert smooth[0] < 0.25 * millimetres and smooth[1] < 0.5 * millimetres
    assert smooth[0] < 0.75 * rough[0]


def test_expressions_do_not_move_the_head():
    """A mouth that opens by 3 cm, and eyes that blink, leave the pose where it was."""
    poses, face = faces.motion(60, 25), faces.face()
    opened = np.repeat(face[None], 60, 0)
    gap = 0.015 * (1 - np.cos(np.arange(60)))[:, None]
    opened[:, 5:12, 1] -= gap
    opened[:, 54:60, 1] -= gap
    opened[::20, 37:39, 1] -= 0.01
    track = head_from_landmarks(faces.moved(poses, opened))
    degrees, millimetres = faces.errors(track.world_from_head, poses)
    assert degrees < 0.05 and millimetres < 0.1


def test_missing_landmarks_and_stray_ones():
    random = np.random.default_rng(4)
    poses, face = faces.motion(60, 15), faces.face()
    points = faces.moved(poses, face)
    points[random.random(points.shape[:2]) < 0.3] = np.nan
    track = head_from_landmarks(points)
    assert max(faces.errors(track.world_from_head, poses)) < 1e-6
    np.testing.assert_allclose(track.points, faces.moved(poses, face), atol=1e-8)
    points[np.arange(60), random.integers(17, 48, 60)] += 0.3  # one wild point in each frame
    degrees, millimetres = faces.errors(head_from_landmarks(points).world_from_head, poses)
    assert degrees < 0.05 and millimetres < 0.1


def test_short_gaps_are_bridged_and_long_ones_are_not():
    poses = faces.motion(60, 15)
    points = faces.moved(poses, faces.face())
    points[10 : 10 + LONGEST_GAP] = np.nan
    points[30 : 31 + LONGEST_GAP] = np.nan
    points[:2] = np.nan
    track = head_from_landmarks(points)
    lost = [frame for frame in range(60) if track.pose(frame) is None]
    assert lost == [0, 1, *range(30, 31 + LONGEST_GAP)]
    assert all(track.landmarks(frame) is None for frame in lost)
    found = [frame for frame in range(60) if frame not in lost]
    degrees, millimetres = faces.errors(track.world_from_head[found], poses[found])
    assert degrees < 1.0 and millimetres < 5.0
    np.testing.assert_allclose(
        track.landmarks(12), faces.moved(track.world_from_head[12:13], track.face)[0], atol=1e-9
    )


def test_a_landmark_never_seen_stays_unknown():
    points = faces.moved(faces.motion(9, 15), faces.face())
    points[:, 5] = np.nan
    track = head_from_landmarks(points)
    assert np.isnan(track.face[5]).all() and track.landmarks(3) is None
    assert track.pose(3) is not None


def test_nothing_to_track():
    assert head_from_landmarks(np.full((5, 68, 3), np.nan)) is None
    points = faces.moved(faces.motion(5, 15), faces.face())
    points[:, 20:] = np.nan
    assert head_from_landmarks(points) is None


def test_one_frame():
    poses = faces.motion(1, 15)
    track = head_from_landmarks(faces.moved(poses, faces.face()))
    np.testing.assert_allclose(track.points[0], faces.moved(poses, faces.face())[0], atol=1e-9)
