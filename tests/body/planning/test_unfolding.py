"""Frames that join the training of a window one after another."""

from collections import Counter

from ico3d.body.planning.unfolding import Unfolding
from ico3d.body.planning.windows import Window

WINDOW = Window(10, 15)  # centre 12


def _unfolding(frames=tuple(WINDOW.frames), steps=1_020, share=0.5, seed=0):
    return Unfolding(WINDOW, frames, first=20, steps=steps, share=share, seed=seed)


def test_each_frame_joins_once_after_its_inner_neighbour():
    """From the middle outwards, before the share of the steps is over."""
    unfolding = _unfolding()
    joined = [pair for step in range(1_020) for pair in unfolding.joining(step)]
    assert joined == [(11, 12), (13, 12), (10, 11), (14, 13), (15, 14)]
    assert not any(unfolding.joining(step) for step in range(20))
    assert any(unfolding.joining(step) for step in range(340, 370))  # a third of three
    assert not any(unfolding.joining(step) for step in range(20 + 510, 1_020))


def test_no_frame_is_learnt_before_it_joins():
    """The first third knows the middle frame and its neighbours alone."""
    unfolding = _unfolding()
    drawn = [unfolding.frame(step) for step in range(20, 180)]
    assert set(drawn) == {11, 12, 13}


def test_all_frames_have_had_as_many_steps_in_the_end():
    """Those that join late are drawn more often; in other orders by other seeds."""
    unfoldings = [_unfolding(seed=seed) for seed in (0, 1)]
    orders = [[unfolding.frame(step) for step in range(20, 1_020)] for unfolding in unfoldings]
    for order in orders:
        assert all(abs(count - 1_000 / 6) < 10 for count in Counter(order).values())
    assert orders[0] != orders[1]


def test_frames_without_pictures_are_not_drawn():
    """Even the middle one."""
    unfolding = _unfolding(frames=(10, 14, 15), steps=120)
    assert {unfolding.frame(step) for step in range(20, 120)} == {10, 14, 15}
