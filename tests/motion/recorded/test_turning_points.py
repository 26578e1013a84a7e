"""Turning points, and swings between them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ico3d.motion.recorded.turning_points import runs, swings, turning_points


def test_highs_and_lows_of_a_wave():
    values = np.cos(np.linspace(0, 4 * np.pi, 41))
    assert turning_points(values, 0.5) == [0, 10, 20, 30, 40]
    assert turning_points(values, 2.1) == []


@given(st.lists(st.floats(-10, 10), min_size=0, max_size=40), st.floats(0.1, 5))
def test_they_ascend_and_change_by_as_much_in_turn(values, least):
    array = np.array(values, float)
    found = turning_points(array, least)
    assert found == sorted(set(found))
    steps = np.diff(array[found])
    assert (np.abs(steps) >= least).all() and (steps[1:] * steps[:-1] < 0).all()


def test_swings_leave_out_what_stays_and_drifts():
    drift = np.linspace(0, 1, 20)
    up, down = np.linspace(2, 8, 4), np.linspace(8, 0, 5)
    values = np.concatenate([drift, up, np.full(6, 8.0), down, -drift])
    first, second = swings(values, 4.0)
    assert (first.begin, first.end, second.begin, second.end) == (19, 23, 30, 34)
    assert first.change == 7 and second.change == -8


def test_runs_of_truth():
    assert runs(np.array([1, 0, 1, 1, 0, 1], bool)) == [(0, 0), (2, 3), (5, 5)]
    assert runs(np.zeros(3, bool)) == []
