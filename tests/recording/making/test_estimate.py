"""The time that is left: as planned, then as fast as the steps go."""

import pytest

from ico3d.recording.making.estimate import Estimate

PLAN = {"track": 100.0, "learn": 200.0, "measure": 10.0}


def test_at_first_the_plan_counts():
    estimate = Estimate(PLAN)
    assert estimate.left("track", 0.0, 0.0) == 310.0
    assert estimate.left("learn", 0.0, 500.0) == 210.0


def test_learning_at_half_the_speed_doubles_what_is_left_of_it_and_of_what_follows():
    estimate = Estimate(PLAN)
    estimate.left("learn", 0.0, 0.0)
    assert estimate.left("learn", 0.1, 40.0) == pytest.approx(0.9 * 300 + 15)  # half believed
    assert estimate.left("learn", 0.5, 200.0) == pytest.approx(0.5 * 400 + 20)
    assert estimate.left("measure", 0.0, 400.0) == pytest.approx(20)


def test_learning_that_goes_on_amid_is_timed_from_there():
    estimate = Estimate(PLAN)
    assert estimate.left("learn", 0.6, 1000.0) == pytest.approx(0.4 * 200 + 10)
    assert estimate.left("learn", 0.8, 1010.0) == pytest.approx(0.2 * 50 + 2.5)


def test_tracking_whose_parts_differ_is_believed_as_far_as_it_went():
    estimate = Estimate(PLAN)
    estimate.left("track", 0.0, 0.0)
    assert estimate.left("track", 0.5, 100.0) == pytest.approx(0.5 * 150 + 210)


def test_what_is_done_or_unplanned_takes_nothing():
    estimate = Estimate({"track": 0.0, "learn": 200.0})
    assert estimate.left("track", 1.0, 3.0) == 200.0
    assert estimate.left("bake", 0.0, 9.0) == 0.0
