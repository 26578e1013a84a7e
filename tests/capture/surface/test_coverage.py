"""What masks show of a person where no surface point lies."""

import numpy as np
import pytest

from ico3d.capture.surface.coverage import find_gap
from ico3d.capture.surface.hull import Silhouette
from support.recordings import two_balls

pytestmark = pytest.mark.slow

SIZE, REACH = 96, 0.02
PIXEL = 0.44 / SIZE
"""Metres, at the person."""


@pytest.fixture(scope="module")
def cameras():
    return two_balls.arc(SIZE)


def _moment(cameras, pose=None):
    """What the cameras see of the person, in head space."""
    where = np.eye(4) if pose is None else pose
    return {
        number: Silhouette(camera.moved(where), two_balls.seen_by(camera, where)[0] >= 0)
        for number, camera in enumerate(cameras)
    }


def _filled(points, gap, moments):
    """Share of the person that is still left out once the gap's points are there."""
    return find_gap(np.concatenate([points, gap.points]), moments, REACH).share


def test_points_on_the_head_alone_leave_the_trunk_to_the_masks(cameras):
    moments, head = [_moment(cameras)], two_balls.ball_points(0, 1500)
    gap = find_gap(head, moments, REACH)
    shown = np.stack([two_balls.seen_by(camera)[0] for camera in cameras])
    assert gap.share == pytest.approx((shown == 1).sum() / (shown >= 0).sum(), abs=0.08)
    assert _filled(head, gap, moments) == 0
    # nothing is added about the head, and what is added lies before or on the trunk
    assert np.linalg.norm(gap.points, axis=1).min() > two_balls.HEAD
    assert np.median(np.abs(two_balls.outside(gap.points))) < 0.03


def test_points_all_over_the_person_are_left_alone(cameras):
    points = np.concatenate([two_balls.ball_points(ball, 1500) for ball in (0, 1)])
    gap = find_gap(points, [_moment(cameras)], REACH)
    assert gap.share == 0 and gap.points.shape == (0, 3)


def test_a_trunk_that_stays_when_the_head_turns_is_found(cameras):
    capture = two_balls.TwoBalls(None)
    moments = [_moment(cameras, capture.world_from_head(frame)) for frame in (0, 3, 10, 17)]
    head = two_balls.ball_points(0, 1500)
    gap = find_gap(head, moments, REACH)
    assert 0.4 < gap.share < 0.75
    assert _filled(head, gap, moments) == 0
    assert np.quantile(two_balls.outside(gap.points), 0.9) < 0.08


@pytest.fixture(scope="module")
def good(cameras):
    """What three moments with good masks show beside the head."""
    return find_gap(two_balls.ball_points(0, 1500), [_moment(cameras)] * 3, REACH)


@pytest.mark.parametrize("wrong", ["everything", "nothing", "head alone"])
def test_one_wrong_mask_changes_little(cameras, good, wrong):
    moments = [_moment(cameras) for _ in range(3)]
    bad = moments[1][2].mask
    bad[:] = wrong == "everything"
    if wrong == "head alone":
        bad[:] = two_balls.seen_by(cameras[2])[0] == 0
    gap = find_gap(two_balls.ball_points(0, 1500), moments, REACH)
    assert gap.share == pytest.approx(good.share, abs=0.05)
    for low_or_high in (np.min, np.max):
        one, other = (low_or_high(found.points, axis=0) for found in (gap, good))
        np.testing.assert_allclose(one, other, atol=0.03)


def test_what_the_picture_cuts_goes_on_to_its_edge(cameras):
    for camera in cameras:
        assert (two_balls.seen_by(camera)[0][-1] == 1).any()
    gap = find_gap(two_balls.ball_points(0, 1500), [_moment(cameras)], REACH)
    lowest = max(camera.project(gap.points)[0][:, 1].max() for camera in cameras)
    assert lowest > SIZE - 3
    held = sum(
        ((pixels >= 0) & (pixels < SIZE)).all(1)
        for pixels in (camera.project(gap.points)[0] for camera in cameras)
    )
    assert held.min() > 3  # nothing is guessed where half of the pictures do not reach


def test_masks_that_no_two_sides_saw_fill_nothing(cameras):
    head = two_balls.ball_points(0, 1500)
    one = _moment(cameras[:1])
    assert len(find_gap(head, [one], REACH).points) == 0
    assert find_gap(head, [], REACH).share == 0
    empty = {0: Silhouette(one[0].camera, np.zeros_like(one[0].mask))}
    assert find_gap(head, [empty], REACH).share == 0


def test_points_behind_the_camera_account_for_nothing(cameras):
    behind = two_balls.ball_points(0, 100) + np.array([0, 0, 50.0])
    assert find_gap(behind, [_moment(cameras)], REACH).share == 1
