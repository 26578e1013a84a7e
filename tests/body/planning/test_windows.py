"""Windows follow the motion, within their bounds."""

from itertools import pairwise, takewhile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.body.planning.windows import Window, cut, segments
from ico3d.errors import SettingsError


def _lengths(windows):
    return [len(window) for window in windows]


def _dividable(frames, shortest, longest):
    """Whether windows of these lengths, sharing a frame each, can cover so many frames."""
    reached = {1}
    for end in range(2, frames + 1):
        if any(end - length + 1 in reached for length in range(shortest, longest + 1)):
            reached.add(end)
    return frames in reached


def test_time_within_a_window():
    window = Window(10, 14)
    assert len(window) == 5
    assert [window.tau(frame) for frame in (10, 11, 14, 12.5)] == [0, 0.25, 1, 0.625]
    assert Window(3, 3).tau(3) == 0


def test_it_cuts_before_the_step_that_is_too_much():
    motion = [1, 1, 1, 9, 1, 1]  # a jump from frame 3 to 4
    assert cut(motion, 10, 2, 20) == (Window(0, 3), Window(3, 5), Window(5, 6))
    assert cut(motion, 11, 2, 20) == (Window(0, 3), Window(3, 6))
    assert cut(motion, 12, 2, 20) == (Window(0, 4), Window(4, 6))


def test_a_window_ends_before_the_burst_that_does_not_fit():
    burst = [0, 0, 0, 0, 0, 2, 4, 4, 4, 0, 0, 0, 0]
    # the sum passes 9 amid the burst; what is less than 9 / 2 / 9 = 0.5 is calm
    assert cut(burst, 9, 2, 10) == (Window(0, 5), Window(5, 7), Window(7, 13))
    # the longest length ends amid the burst, too; all of it fits into the next window
    assert cut(burst, 15, 2, 8) == (Window(0, 5), Window(5, 12), Window(12, 13))
    # a burst that has just ended is no reason to go back
    assert cut(burst, 15, 2, 10) == (Window(0, 9), Window(9, 13))
    # never below the shortest length
    assert cut(burst, 9, 7, 10) == (Window(0, 7), Window(7, 13))


def test_a_sum_that_equals_the_threshold_is_not_above_it():
    assert cut([2, 2, 2, 2], 4, 2, 9) == (Window(0, 2), Window(2, 4))


def test_the_longest_and_the_shortest_hold():
    assert _lengths(cut(np.zeros(40), 1, 2, 11)) == [11, 11, 11, 11]
    assert _lengths(cut(np.full(40, 5.0), 1, 11, 20)) == [11, 11, 11, 11]


def test_a_rest_that_is_too_short_takes_frames_from_the_window_before():
    assert _lengths(cut(np.zeros(22), 1, 6, 11)) == [11, 8, 6]


def test_a_rest_that_no_shorter_window_would_mend_is_merged():
    assert _lengths(cut([3, 3, 3, 3, 3, 3, 3], 9, 4, 9)) == [4, 5]
    assert _lengths(cut([9] * 7, 1, 5, 9)) == [8]


def test_a_clip_that_cannot_be_divided_has_longer_windows():
    assert _lengths(cut(np.zeros(7), 1, 6, 7)) == [8]
    assert _lengths(cut(np.zeros(11), 1, 6, 6)) == [7, 6]


def test_a_clip_shorter_than_a_window_is_one():
    assert cut([], 1, 6, 20) == (Window(0, 0),)
    assert cut([100.0, 100.0], 1, 6, 20) == (Window(0, 2),)


@pytest.mark.parametrize("bounds", [(1, 1, 5), (1, 6, 5), (0, 6, 20), (float("nan"), 6, 20)])
def test_contradicting_settings_are_one_sentence(bounds):
    with pytest.raises(SettingsError, match="impossible"):
        cut([1.0], *bounds)


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_motion_is_checked(value):
    with pytest.raises(ValueError, match="motion"):
        cut([1.0, value], 1, 2, 5)


@given(
    st.lists(st.floats(0, 50), max_size=80),
    st.floats(0.01, 200),
    st.integers(2, 12),
    st.integers(0, 20),
)
def test_windows_cover_all_frames_within_the_bounds(motion, threshold, shortest, more):
    longest, frames = shortest + more, len(motion) + 1
    windows = cut(motion, threshold, shortest, longest)
    assert windows[0].first == 0 and windows[-1].last == frames - 1
    assert all(before.last == after.first for before, after in pairwise(windows))
    assert all(len(window) >= min(shortest, frames) for window in windows)
    if _dividable(frames, shortest, longest):
        assert all(len(window) <= longest for window in windows)


@given(st.lists(st.floats(0, 50), min_size=1, max_size=80), st.floats(0.01, 200))
def test_no_window_moves_more_than_the_threshold_where_any_length_is_allowed(motion, threshold):
    windows = cut(motion, threshold, 2, len(motion) + 1)
    for number, window in enumerate(windows):
        moved = sum(motion[window.first : window.last])
        assert len(window) == 2 or moved <= threshold * (1 + 1e-9)
        if number + 1 < len(windows) and moved + motion[window.last] <= threshold * (1 - 1e-9):
            # only to leave a burst to the next window: what follows at once does not fit
            calm = threshold / 2 / len(motion)
            burst = list(takewhile(calm.__lt__, motion[window.last :]))
            assert motion[window.last - 1] <= calm and moved + sum(burst) > threshold * (1 - 1e-9)


def test_segments_are_of_equal_length():
    """The paper's clip has 225 frames, in five segments of 45."""
    found = segments(225, 45)
    assert len(found) == 5 and (found[0].first, found[-1].last) == (0, 224)
    assert all(a.last == b.first for a, b in pairwise(found))
    assert set(_lengths(found)) == {45, 46}
    assert segments(9, 0) == (Window(0, 8),) and segments(1, 45) == (Window(0, 0),)
