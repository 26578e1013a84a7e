"""Brows rise with stressed syllables, the same however the sound is cut."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.common.expression import EYE_NAMES
from ico3d.speech.emphasis import AHEAD, HEIGHTS, NEEDED, PAUSE, RISE, Emphasis

RATE, ROW = 24_000, 960
RAISED = [EYE_NAMES.index(f"brow{n}") for n in ("InnerUp", "OuterUpLeft", "OuterUpRight")]


def voice(levels):
    """(S,) a tone whose rows have these levels in dB."""
    tone = np.sin(2 * np.pi * 150 * np.arange(len(levels) * ROW) / RATE)
    return tone * np.repeat(10 ** (np.asarray(levels, float) / 20), ROW)


def values(levels, emphasis=None, first=0):
    times = (first + np.arange(len(levels))) / 25
    return (emphasis or Emphasis()).values(times, voice(levels), RATE)


def test_brows_rise_just_before_a_syllable_that_is_louder_than_the_others():
    levels = np.full(100, -24.0)
    levels[60] = -12
    raised = values(levels)[:, RAISED]
    assert not raised[: 60 - AHEAD + 1].any()
    top = 60 - AHEAD + round(RISE * 25)
    assert raised[top] == pytest.approx(np.full(3, HEIGHTS[1]), abs=0.03)
    assert (np.diff(raised[top:, 0]) <= 1e-6).all() and not raised[-10:].any()


def test_how_high_they_rise_follows_from_how_loud_it_is():
    tops = []
    for louder in (3, 5, 7, 9):
        levels = np.full(100, -24.0)
        levels[60] += louder
        tops.append(values(levels)[:, RAISED].max())
    assert tops[0] == 0 and HEIGHTS[0] < tops[1] < tops[2] < tops[3] < HEIGHTS[1]


def test_even_speech_silence_and_lids_stay_as_they_are():
    assert not values(np.full(100, -20.0)).any()
    assert not values(np.full(100, -90.0)).any()
    rng = np.random.default_rng(0)
    lids = [EYE_NAMES.index(f"eyeBlink{side}") for side in ("Left", "Right")]
    assert not values(rng.uniform(-40, -10, 200))[:, lids].any()


def test_strokes_keep_their_distance():
    rng = np.random.default_rng(1)
    raised = values(rng.uniform(-40, -10, 2000))[:, RAISED[0]]
    begun = np.flatnonzero((raised[1:] > 0) & (raised[:-1] == 0)) / 25
    assert len(begun) > 10 and np.diff(begun).min() >= PAUSE - 1e-9


def test_who_was_interrupted_raises_brows_again():
    levels = np.full(60, -24.0)
    levels[50] = -12
    emphasis = Emphasis()
    first = values(levels, emphasis)
    assert values(levels, emphasis).max() == pytest.approx(first.max(), abs=0.02)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(3, 9), min_size=1, max_size=12), st.integers(0, 99))
def test_pieces_give_what_the_whole_gives(sizes, seed):
    total = sum(sizes)
    sound = voice(np.random.default_rng(seed).uniform(-45, -10, total))
    whole = Emphasis().values(np.arange(total) / 25, sound, RATE)
    emphasis, parts, first = Emphasis(), [], 0
    for size in sizes:
        known = sound[first * ROW : (first + size + NEEDED) * ROW]
        parts.append(emphasis.values((first + np.arange(size)) / 25, known, RATE))
        first += size
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-6)
