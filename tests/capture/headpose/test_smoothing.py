import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ico3d.capture.headpose.smoothing import filled, filled_poses, smoothed_poses, window_of


def _poses(turns, places):
    poses = np.tile(np.eye(4), (len(turns), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    poses[:, :3, 3] = places
    return poses


def _degrees(first, second):
    between = first[:, :3, :3].transpose(0, 2, 1) @ second[:, :3, :3]
    return np.degrees(Rotation.from_matrix(between).magnitude())


def test_windows_last_a_third_of_a_second_at_every_frame_rate():
    assert [window_of(fps, 100) for fps in (5, 15, 25, 30, 60)] == [5, 5, 9, 9, 15]
    assert [window_of(30, count) for count in (4, 5, 8, 9)] == [1, 5, 5, 9]


@settings(max_examples=20)
@given(st.integers(0, 999), st.sampled_from([5.0, 15.0, 30.0]))
def test_parabolas_and_steady_turns_pass_unchanged(seed, fps):
    """No lag and no flattening: also at the first and the last frames."""
    random = np.random.default_rng(seed)
    time = np.arange(24)[:, None] / fps
    places = (
        random.normal(0, 1, 3) + random.normal(0, 1, 3) * time + random.normal(0, 1, 3) * time**2
    )
    axis = random.normal(0, 1, 3)
    turns = axis / np.linalg.norm(axis) * np.radians(360) * time / time[-1]  # all the way
    poses = _poses(turns, places)
    np.testing.assert_allclose(smoothed_poses(poses, fps), poses, atol=1e-9)


def test_jitter_halves_and_nothing_moves_in_time():
    random = np.random.default_rng(0)
    time = np.arange(120)[:, None] / 30
    turns = 0.2 * np.sin(2 * np.pi * (time * [0.7, 0.9, 0.4] + [0, 0.2, 0.5]))
    places = 0.03 * np.sin(2 * np.pi * time * [0.5, 0.8, 0.3])
    truth = _poses(turns, places)
    noisy = _poses(
        turns + random.normal(0, 0.01, turns.shape), places + random.normal(0, 0.002, places.shape)
    )
    smooth = smoothed_poses(noisy, 30)
    assert _degrees(smooth, truth).mean() < 0.6 * _degrees(noisy, truth).mean()
    errors = [
        np.abs(smooth[5 + lag : -5 + lag or None, :3, 3] - truth[5:-5, :3, 3]).mean()
        for lag in range(-3, 4)
    ]
    assert np.argmin(errors) == 3


def test_gaps_are_crossed_straight_and_ends_held():
    turns, places = np.array([[0, 0, 0.2], [0, 0, 1.0]]), np.array([[0.0, 0, 0], [4, 0, 8]])
    every = filled_poses(_poses(turns, places), np.array([1, 5]), 8)
    expected_turn = [0.2, 0.2, 0.4, 0.6, 0.8, 1.0, 1.0, 1.0]
    found = Rotation.from_matrix(every[:, :3, :3]).as_rotvec()
    np.testing.assert_allclose(found[:, 2], expected_turn, atol=1e-12)
    np.testing.assert_allclose(every[:, 2, 3], [0, 0, 2, 4, 6, 8, 8, 8])
    values = filled(np.array([[1.0], [3.0]]), np.array([1, 3]), 5)
    np.testing.assert_allclose(values[:, 0], [1, 1, 2, 3, 3])


@pytest.mark.parametrize("count", [1, 4])
def test_short_captures_stay_as_they_are(count):
    poses = filled_poses(_poses(np.array([[0, 1.0, 0]]), np.ones((1, 3))), np.array([0]), count)
    np.testing.assert_array_equal(smoothed_poses(poses, 25), poses)
