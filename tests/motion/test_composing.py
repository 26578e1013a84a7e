"""Strokes on accents, in speech that grows; bodies that follow directions smoothly; gaze."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.motion.clip import Clip
from ico3d.motion.composing.accents import FRAME, Word
from ico3d.motion.composing.composer import NOD, NODS_APART, Composer
from ico3d.motion.composing.cues import SETTLE, Cue, Direction, Release, clip_time, weight
from ico3d.motion.composing.gaze import CHEST_YAW, FACE_SPEED, HEAD_YAW, Gaze, direction_to
from ico3d.motion.composing.performer import Performer
from ico3d.motion.composing.takes import limbs
from ico3d.motion.living import Living, living
from ico3d.motion.roles import INDEX, SIDES
from ico3d.motion.turning import twist_angle
from support.rigs import gestures_of, rig_of
from support.spoken import speech

pytestmark = pytest.mark.slow
FASTEST = 1000.0
"""Degrees a second that a joint turns at most, however gestures follow one another."""


@pytest.fixture(scope="module")
def rest() -> Living:
    return living(rig_of("SMPL-X", 0.0), 1)


@pytest.fixture(scope="module")
def clips() -> dict[str, Clip]:
    return gestures_of("SMPL-X", 0.0)


def grown(clips, seed: int, step: float, ahead: float = 1.5) -> list[Direction]:
    """Directions of a speech that is known a little ahead of when it is heard."""
    words, levels = speech(seed)
    seconds = len(levels) * FRAME
    composer, found, now = Composer(clips, seed), [], 0.0
    while now < seconds + 3:
        known = now + step + ahead
        composer.know(tuple(w for w in words if w.end <= known), levels[: round(known / FRAME)])
        if known >= seconds:
            composer.end(seconds)
        new = composer.directions(now + step)
        assert all(now - 1e-9 <= moment(d) < now + step + 3 for d in new)
        assert all(d.begin < now + step for d in new if isinstance(d, Cue))
        found += new
        now += step
    return found


def moment(direction: Direction) -> float:
    return direction.begin if isinstance(direction, Cue) else direction.time


def sides(cue: Cue, clips) -> set[str]:
    other = {"left": "right", "right": "left", "head": "head"}
    return {other[limb] if cue.mirror else limb for limb in limbs(clips[cue.name])}


@settings(max_examples=5)
@given(st.integers(0, 10_000), st.sampled_from([0.2, 0.5, 1.0]))
def test_strokes_fall_on_accents_and_none_is_cut_off(clips, seed, step):
    words, _ = speech(seed)
    found = grown(clips, seed, step)
    cues = [d for d in found if isinstance(d, Cue)]
    releases = {d.number: d.time for d in found if isinstance(d, Release)}
    peaks = np.array([(word.begin + word.end) / 2 for word in words])
    assert len(cues) >= 4 and set(releases) == {cue.number for cue in cues}
    assert sorted(releases) == list(range(len(cues)))
    cues.sort(key=lambda cue: cue.number)
    for number, cue in enumerate(cues):
        assert np.abs(peaks - cue.stroke).min() <= 0.03
        held = clips[cue.name].marks.release > clips[cue.name].marks.hold
        assert releases[number] >= cue.stroke + (SETTLE if held else 0) - 1e-9
        for other in cues[:number]:
            if sides(cue, clips) & sides(other, clips):
                assert cue.begin >= other.stroke + SETTLE - 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_the_head_nods_to_what_hands_leave_and_takes_nothing_from_them(clips, seed):
    still = {name: clip for name, clip in clips.items() if name != NOD}
    cues, without = (
        [d for d in grown(some, seed, 0.5) if isinstance(d, Cue)] for some in (clips, still)
    )
    nods = [cue.stroke for cue in cues if cue.name == NOD]
    assert len(nods) >= 3
    assert min(np.diff(sorted(nods))) >= NODS_APART[0] - 1e-9

    def hands(found):
        return [(c.name, c.mirror, c.stroke) for c in found if "head" not in sides(c, clips)]

    assert hands(cues) == hands(without)


def test_words_get_their_gestures(clips):
    words, levels = speech(3)
    composer = Composer(clips, 0)
    composer.know(words, levels)
    composer.end(len(levels) * FRAME)
    found = composer.directions(math.inf)
    shown = {}
    for cue in (d for d in found if isinstance(d, Cue)):
        word = min(words, key=lambda w: abs((w.begin + w.end) / 2 - cue.stroke))
        shown[word.text] = cue.name
    assert shown.get("three") == "count_three" and shown.get("yes") == "nod"
    assert shown.get("second") == "count_two"


@pytest.mark.parametrize("start", [0.0, 0.4])
def test_a_greeting_with_the_first_word_is_waved_on_the_next_accents(clips, start):
    """Also where the page reported late that it plays, so that no gesture could begin before."""
    words = (Word("hello", 0.1, 0.4), Word("lovely", 0.4, 0.7), Word("people", 0.7, 1.1))
    words += (Word("everywhere", 1.2, 1.6),)
    times = np.arange(0, 2, FRAME)
    levels = np.max([-30 * np.abs(times - (w.begin + w.end) / 2) / 0.3 for w in words], 0)
    composer = Composer(clips, 0, start)
    composer.know(words, np.maximum(levels, -70.0))
    composer.end(2.0)
    cue = composer.directions(math.inf)[0]
    assert isinstance(cue, Cue) and cue.name == "wave"
    assert cue.begin == pytest.approx(0.46, abs=0.02) if start else cue.begin == 0.0
    assert cue.stroke == pytest.approx(1.4 if start else 0.9, abs=0.02)


def test_what_is_asked_for_is_made_at_once_and_held_for_two_rounds(clips):
    composer = Composer(clips, 0, start=4.0)
    composer.request("wave")
    cue, release = composer.directions(9.0)
    marks = clips["wave"].marks
    assert cue == Cue(0, "wave", False, 4.0, 4.0 + marks.stroke, 0.0)
    assert release.time == pytest.approx(cue.stroke + 2 * (marks.release - marks.hold))
    assert composer.directions(99.0) == []
    with pytest.raises(KeyError):
        composer.request("somersault")


def test_the_same_seed_makes_the_same_gestures_another_one_others(clips):
    assert grown(clips, 7, 0.5) == grown(clips, 7, 0.5)
    words, levels = speech(7)
    made = []
    for seed in range(6):
        composer = Composer(clips, seed)
        composer.know(words, levels)
        composer.end(len(levels) * FRAME)
        made.append(composer.directions(math.inf))
    assert any(made[0] != other for other in made[1:])


def test_an_interruption_lets_go_after_the_stroke_and_drops_what_has_not_begun(clips, rest):
    words, levels = speech(3)
    composer, performer = Composer(clips, 0), Performer(rest, clips)
    composer.know(words, levels)
    first = composer.directions(4.0)
    performer.follow(first)
    cues = [d for d in first if isinstance(d, Cue)]
    now = cues[-1].begin + 0.1
    let_go = composer.stop(now)
    assert {d.number for d in first + let_go if isinstance(d, Release)} == {c.number for c in cues}
    stroke = {cue.number: cue.stroke for cue in cues}
    assert let_go and all(now <= d.time and stroke[d.number] <= d.time for d in let_go)
    assert composer.directions(math.inf) == []
    performer.follow(let_go)
    performer.drop(cues[-1].begin)
    pose, _ = performer.at(np.array([cues[-1].stroke + 5]))
    np.testing.assert_allclose(pose, rest.at(np.array([cues[-1].stroke + 5]))[0], atol=1e-12)


def test_without_sound_nobody_gestures(clips):
    composer = Composer(clips, 0)
    composer.know((), np.zeros(0))
    composer.end(0.0)
    assert composer.directions(math.inf) == []


def test_a_wave_goes_round_in_its_hold(clips):
    clip = clips["wave"]
    cue = Cue(0, "wave", False, 1.0, 2.0)
    around = clip.marks.release - clip.marks.hold
    times = np.array([0.0, 1.0, 2.0, 2.0 + 0.3 * around, 2.0 + 1.3 * around])
    wanted = [0, 0, clip.marks.stroke, *[clip.marks.hold + 0.3 * around] * 2]
    np.testing.assert_allclose(clip_time(clip, cue, None, times), wanted, atol=1e-9)
    release = 2.0 + 2 * around
    later = np.array([release, release + 0.2, release + 9])
    wanted = [clip.marks.release, clip.marks.release + 0.2, clip.marks.end]
    np.testing.assert_allclose(clip_time(clip, cue, release, later), wanted, atol=1e-9)
    np.testing.assert_array_equal(weight(clip, cue, release, np.array([1.0, 2.0, 9.0])), [0, 1, 0])


@settings(max_examples=3)
@given(st.integers(0, 10_000))
def test_bodies_move_smoothly_within_limits_over_feet_that_stay(clips, rest, seed):
    performer = Performer(rest, clips)
    performer.follow(grown(clips, seed, 0.5))
    times = np.arange(0, 14, 0.02)
    pose, root = performer.at(times)
    assert np.isfinite(pose).all()
    near = np.abs((pose[1:] * pose[:-1]).sum(-1)).clip(0, 1)
    assert np.degrees(2 * np.arccos(near)).max() / 0.02 < FASTEST
    wrists = pose[:, [INDEX[f"{side}_wrist"] for side in SIDES], 0]
    assert np.degrees(2 * np.arccos(np.abs(wrists).clip(0, 1))).max() < 90
    some = slice(0, None, 10)
    places = rest.person.posed(pose[some], root[some])
    for side in SIDES:
        assert np.ptp(places[f"{side}_ankle"], axis=0).max() < 0.005
        speed = np.linalg.norm(np.diff(places[f"{side}_wrist"], axis=0), axis=1) / 0.2
        assert speed.max() < 3.0
    np.testing.assert_allclose(performer.at(times[333])[0][0], pose[333], atol=1e-9)


def test_gestures_come_upon_the_rest_and_leave_it_again(clips, rest):
    performer = Performer(rest, clips)
    performer.follow([Cue(0, "beat_right", True, 1.0, 1.65), Release(0, 2.0)])
    still, _ = rest.at(np.array([0.5, 1.6, 9.0]))
    pose, _ = performer.at(np.array([0.5, 1.6, 9.0]))
    np.testing.assert_allclose(pose[[0, 2]], still[[0, 2]], atol=1e-12)
    moved = np.flatnonzero(np.abs(pose[1] - still[1]).max(-1) > 0.05)
    assert INDEX["left_elbow"] in moved and INDEX["right_elbow"] not in moved


def test_the_head_turns_first_then_the_chest_within_limits():
    gaze = Gaze()
    gaze.look(math.radians(75.0), math.radians(10.0))
    turns = np.stack([gaze.at(0.02 * i) for i in range(200)])  # (200, 3, 4)
    up, down = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    chest = twist_angle(turns[:, 0], up)
    head = 2 * twist_angle(turns[:, 1], up)
    reached = [int(np.argmax(angle > 0.5 * angle[-1])) for angle in (head, chest)]
    assert reached[0] < reached[1]
    assert np.degrees(chest[-1]) == pytest.approx(24.0, abs=0.2) and chest.max() <= CHEST_YAW + 0.02
    assert np.degrees(head[-1]) == pytest.approx(50.0, abs=0.5) and head.max() <= HEAD_YAW + 0.02
    assert np.abs(np.diff(chest + head)).max() / 0.02 <= FACE_SPEED * 1.01
    assert np.degrees(2 * twist_angle(turns[-1, 1], down)) == pytest.approx(10.0, abs=1.0)


@pytest.mark.parametrize("degrees", [-70.0, 30.0, 57.0, 73.0])
def test_a_face_does_not_turn_past_the_visitor_while_the_chest_catches_up(degrees: float):
    gaze, up = Gaze(), np.array([0.0, 1.0, 0.0])
    gaze.look(math.radians(degrees), 0.0)
    turns = np.stack([gaze.at(0.02 * i) for i in range(200)])  # (200, 3, 4)
    face = np.degrees(twist_angle(turns[:, 0], up) + 2 * twist_angle(turns[:, 1], up))
    assert np.abs(face).max() <= abs(degrees) + 0.3
    arrived = int(np.argmax(np.abs(face) > 0.97 * abs(degrees)))
    np.testing.assert_allclose(face[arrived:], degrees, atol=0.03 * abs(degrees))


def test_who_goes_behind_is_looked_after_on_the_side_where_they_went():
    gaze, up = Gaze(), np.array([0.0, 1.0, 0.0])
    turns: list[float] = []
    for second, degrees in enumerate((100.0, 170.0, -170.0, -125.0, -100.0)):
        gaze.look(math.radians(degrees), 0.0)
        turns.append(float(twist_angle(gaze.at(4.0 * (second + 1))[1], up)))
    assert np.sign(turns).tolist() == [1, 1, 1, 1, -1]
    start = Gaze()
    start.look(math.radians(-150.0), 0.0)
    assert twist_angle(start.at(2.0)[1], up) < 0


def test_a_visitor_is_to_the_left_or_below():
    eyes = np.array([0.0, 1.6, 0.1])
    yaw, pitch = direction_to(eyes, eyes + np.array([1.0, -1.0, 1.0]))
    assert yaw == pytest.approx(math.radians(45)) and pitch == pytest.approx(math.atan(1 / 2**0.5))
