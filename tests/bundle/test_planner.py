"""What a planned motion keeps to, for all animations, starts and speeches."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.bundle.animation import Action, Animation, Rest
from ico3d.bundle.planner import EASE, SHORTEST, Planner, Start, leg, plan, speed_for, travel

pytestmark = pytest.mark.slow

CLOSE = 1e-6


@st.composite
def animations(draw):
    """Any: rest before, amid or after the actions, few or many of them."""
    fps = draw(st.sampled_from([15.0, 25.0, 30.0]))
    frames = draw(st.integers(2, 300))
    start = draw(st.integers(0, frames - 2))
    end = draw(st.integers(start + 1, frames - 1))
    places = draw(st.lists(st.integers(0, frames - 1), max_size=8, unique=True))
    scores = draw(st.lists(st.floats(0, 1), min_size=len(places), max_size=len(places)))
    actions = tuple(Action(f, s) for f, s in zip(places, scores, strict=True))
    low = draw(st.floats(0.3, 1.0))
    return Animation(fps, frames, Rest(start, end), actions, low, low * draw(st.floats(1, 2)))


@st.composite
def starts(draw, animation):
    return Start(
        draw(st.floats(0, animation.seconds)),
        draw(st.sampled_from([0.0, 0.0, 0.8, 1.0, -1.0, -3.0])),
    )


def turning_places(animation):
    frames = [animation.rest.start, animation.rest.end, *(a.frame for a in animation.actions)]
    return np.array(frames) / animation.fps


def soonest(animation, start):
    """Seconds until it can be at rest, if all it does is go there."""
    home, place, seconds = animation.rest.end / animation.fps, start.body_time, 0.0
    if start.velocity:
        ways = turning_places(animation) - place
        ahead = np.abs(ways[(ways * start.velocity > 0) & (np.abs(ways) > CLOSE)])
        if len(ahead):
            speed = np.clip(abs(start.velocity), animation.min_speed, animation.max_speed)
            seconds = travel(ahead.min(), speed, 1)
            place += np.copysign(ahead.min(), start.velocity)
    way = abs(home - place)
    return seconds + (travel(way, animation.max_speed) if way > CLOSE else 0.0)


def check(animation, start, points):
    """Continuity, speeds, and where motion turns around."""
    times, places = np.array(points).T
    assert (np.diff(times) > -CLOSE).all()
    assert places.min() >= -CLOSE and places.max() <= animation.seconds + CLOSE
    steps = np.diff(times) > CLOSE
    assert np.abs(np.diff(places)[~steps]).max(initial=0) <= CLOSE
    speeds = np.diff(places)[steps] / np.diff(times)[steps]
    assert np.abs(speeds).max(initial=0) <= animation.max_speed + 1e-4
    assert places[-1] == pytest.approx(animation.rest.end / animation.fps)
    check_turns(animation, start, np.stack([times, places], 1))
    check_slow(animation, times, places)


def check_turns(animation, start, points):
    """Between one direction and the other it stands on a key frame, unless it may choose."""
    moves = points[1:] - points[:-1]
    moving = np.flatnonzero(np.abs(moves[:, 1]) > CLOSE)
    signs = np.sign(moves[moving, 1])
    allowed = turning_places(animation)
    for index in np.flatnonzero(np.diff(signs)):
        assert np.abs(allowed - points[moving[index] + 1, 1]).min() <= CLOSE
    ahead = (allowed - start.body_time) * start.velocity > CLOSE
    if len(signs) and ahead.any():
        assert signs[0] == np.sign(start.velocity)


def check_slow(animation, times, places):
    """Motion that is neither at its beginning nor at its end is never slower than the least."""
    moves = np.abs(np.diff(places)) > CLOSE
    still = np.concatenate([times[:1], times[:-1][~moves], times[1:][~moves], times[-1:]])
    turning = [t for t, p in zip(times, places, strict=True) if _near(animation, p)]
    calm = np.concatenate([still, turning])
    for index in np.flatnonzero(moves):
        begin, end = times[index], times[index + 1]
        if np.abs(calm - begin).min() >= EASE - CLOSE and np.abs(calm - end).min() >= EASE - CLOSE:
            speed = abs(places[index + 1] - places[index]) / (end - begin)
            assert speed >= animation.min_speed - 1e-4


def _near(animation, place):
    return np.abs(turning_places(animation) - place).min() <= CLOSE


@settings(max_examples=60)
@given(st.data(), animations(), st.floats(0, 40), st.integers(0, 2**32), st.booleans())
def test_a_plan_ends_at_rest_with_the_speech(data, animation, seconds, seed, gestures):
    start = data.draw(starts(animation))
    points = plan(animation, start, seconds, np.random.default_rng(seed), gestures)
    assert points[0] == (0.0, pytest.approx(start.body_time))
    check(animation, start, points)
    latest = max(seconds, soonest(animation, start))
    assert seconds - CLOSE <= points[-1][0] <= latest + 1 / animation.fps
    assert points == plan(animation, start, seconds, np.random.default_rng(seed), gestures)


def test_a_long_way_home_is_not_taken_too_slowly():
    animation = Animation(15.0, 46, Rest(0, 45), ())
    for seed in range(20):
        points = plan(animation, Start(0.0), 4.7, np.random.default_rng(seed), gestures=False)
        assert points[-1] == (pytest.approx(4.7, abs=1 / 15), pytest.approx(3.0))


@settings(max_examples=60)
@given(st.data(), animations(), st.integers(0, 2**32), st.sampled_from([0.0, 1.0]))
def test_a_growing_plan_never_takes_back_a_point(data, animation, seed, overrun):
    start, at = data.draw(starts(animation)), data.draw(st.floats(0, 1))
    pieces = data.draw(st.lists(st.floats(0.1, 3), max_size=15))
    ahead = data.draw(st.floats(0.5, 2))
    planner = Planner(animation, start, np.random.default_rng(seed), at, overrun=overrun)
    known, points = at, []
    for piece in pieces:
        known += piece
        planner.know(known)
        until = known - 2 + ahead  # what is heard, and so much more
        found = planner.points(until)
        assert all(time <= max(until, at) for time, _ in found)
        points += found
    planner.end(known)
    points += planner.points()
    assert planner.is_over and planner.points() == []
    assert points[0] == (at, pytest.approx(start.body_time))
    check(animation, start, points)
    assert known - CLOSE <= points[-1][0]
    latest = max(known + overrun, at + soonest(animation, start))
    assert points[-1][0] <= latest + 1 / animation.fps


TALK = Animation(
    15.0, 120, Rest(0, 20), (Action(40, 0.9), Action(60, 0.8), Action(75, 0.1), Action(100, 0.7))
)


def visited(points):
    return {round(15 * place, 3) for _, place in points}


def test_a_long_speech_visits_every_action_the_best_ones_most():
    stops = []
    for seed in range(40):
        points = plan(TALK, Start(0.4), 20.0, np.random.default_rng(seed))
        turns = [
            b
            for (_, a), (_, b), (_, c) in zip(points, points[1:], points[2:], strict=False)
            if (b - a) * (c - b) <= 0 and b != a
        ]
        stops += [round(15 * place) for place in turns]
    counts = {action.frame: stops.count(action.frame) for action in TALK.actions}
    assert min(counts.values()) > 0
    assert counts[75] == min(counts.values())
    assert len(stops) / 40 >= 4  # it does not stand about


def test_the_longest_way_has_an_end_soon():
    """A way without an end kept a server busy for ever, at the first sentence."""
    points = leg(7200.0, 0.05, False)
    assert len(points) < 10_020
    (a, b), (c, d) = points[100], points[9000]
    assert (d - b) / (c - a) == pytest.approx(0.05)
    assert points[-1] == pytest.approx((travel(7200.0, 0.05, 2), 7200.0))


def test_seeds_differ():
    one, two = (plan(TALK, Start(0.4), 9.0, np.random.default_rng(seed)) for seed in (1, 2))
    assert one != two


def test_a_speech_too_short_for_a_gesture_ends_at_rest_in_time():
    points = plan(TALK, Start(1.0), 1.2, np.random.default_rng(0))
    assert max(place for _, place in points) <= 20 / 15 + CLOSE
    assert points[-1] == pytest.approx((1.2, 20 / 15))


def test_without_gestures_the_body_is_held_at_rest():
    points = plan(TALK, Start(1.0), 30.0, np.random.default_rng(0), gestures=False)
    assert {place for time, place in points if time > 2} == {20 / 15}


def test_a_moving_body_keeps_its_direction_and_speed():
    points = np.array(plan(TALK, Start(0.9, -1.0), 8.0, np.random.default_rng(0)))
    first = points[points[:, 0] < 0.6]
    assert np.diff(first[:, 1]) / np.diff(first[:, 0]) == pytest.approx(-1.0)
    assert points[:, 1].min() == pytest.approx(0.0, abs=CLOSE)  # it turns at the rest's start


def test_sound_in_small_pieces_leaves_time_for_gestures_with_overrun_only():
    near = Animation(15.0, 41, Rest(0, 13), (Action(20, 0.9), Action(27, 0.8)))
    reached = {}
    for overrun in (0.0, 1.0):
        planner = Planner(near, Start(0.4), np.random.default_rng(0), overrun=overrun)
        points = []
        for heard in np.arange(0.0, 12.0, 0.2):
            planner.know(heard + 1.5)
            points += planner.points(heard + 1)
        reached[overrun] = max(place for _, place in points)
    assert reached[0.0] == pytest.approx(13 / 15)
    assert reached[1.0] >= 20 / 15 - CLOSE


@given(st.floats(0.01, 20), st.floats(0.1, 4))
def test_the_speed_for_a_time_takes_that_time(way, speed):
    assert speed_for(way, travel(way, speed)) == pytest.approx(speed)
    for moving in (False, True):
        times, places = np.array(leg(way, speed, moving)).T
        assert places[-1] == way and times[-1] == pytest.approx(travel(way, speed, 2 - moving))
        assert (np.diff(times) > 0).all() and (np.diff(places) > -CLOSE).all()


@settings(max_examples=40)
@given(st.data())
def test_a_wanted_action_is_the_next_that_is_visited(data):
    animation = data.draw(animations().filter(lambda a: a.actions))
    start = data.draw(starts(animation))
    place = data.draw(st.sampled_from(animation.actions)).frame / animation.fps
    planner = Planner(animation, start, np.random.default_rng(data.draw(st.integers(0, 9))))
    planner.visit(place)
    planner.end(300.0)  # time enough for any way there and back
    points = planner.points()
    check(animation, start, points)
    places = np.array(points)[:, 1]
    if start.velocity == 0 and abs(place - start.body_time) < SHORTEST:
        return  # it is there already
    # A moving body may turn so near to it that going there too would look like trembling.
    enough = CLOSE if start.velocity == 0 else SHORTEST
    reached = np.flatnonzero(np.abs(places - place) < enough)[0]
    ways = np.sign(np.diff(places[: reached + 1]))
    ways = ways[ways != 0]
    assert (np.diff(ways) != 0).sum() <= (0 if start.velocity == 0 else 1)


def test_what_is_no_action_is_not_visited():
    animation = Animation(15.0, 60, Rest(0, 20), (Action(40, 1.0),))
    planner = Planner(animation, Start(1.0), np.random.default_rng(0), gestures=False)
    planner.visit(40 / 15)
    planner.end(30.0)
    assert max(place for _, place in planner.points()) <= 20 / 15 + CLOSE
