"""Gestures found and named in recordings, and clips made of them: what was made comes back."""

from dataclasses import dataclass

import numpy as np
import pytest

from ico3d.motion.clip import Clip, from_bytes, meaning, other_hand, to_bytes
from ico3d.motion.composing.cues import Cue
from ico3d.motion.composing.performer import Performer
from ico3d.motion.curves import angles
from ico3d.motion.living import Living, living
from ico3d.motion.recorded.cut import REST, Cut
from ico3d.motion.recorded.cutting import find_cuts
from ico3d.motion.recorded.making import hung_in, recorded_clips
from ico3d.motion.recorded.recording import Recording, recording_of
from ico3d.motion.roles import INDEX, SIDES
from ico3d.rig.quaternions import from_rotvec, multiply
from support.recorded import Made, performed
from support.rigs import gestures_of, rig_of

pytestmark = pytest.mark.slow
SLOW = ("wave", "think")
"""Gestures whose hands are about where the stroke arrives before it does."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """Somebody who made every gesture of the package once.

    Attributes:
        rest: Who.
        gestures: What they made.
        mirror: With the other hand.
        made: When, by name.
        recording: What is known of it.
        cuts: What was found there.
        clips: What was made of it.
    """

    rest: Living
    gestures: dict[str, Clip]
    mirror: bool
    made: dict[str, Made]
    recording: Recording
    cuts: list[Cut]
    clips: dict[str, Clip]


@pytest.fixture(scope="module", params=["25 a second", "15 a second, mirrored, with jitter"])
def seen(request) -> Recorded:
    mirror = "mirrored" in request.param
    about = ("SMPL-X", 0.0) if mirror else ("MakeHuman", 45.0, 20.0)
    rig, gestures = rig_of(*about), gestures_of(*about)
    fps = 15.0 if mirror else 25.0
    rest = living(rig, 4)
    rotations, made = performed(rest, gestures, fps, mirror)
    if mirror:
        jitter = np.random.default_rng(0).normal(0, np.radians(0.3), (*rotations.shape[:-1], 3))
        rotations = multiply(rotations, from_rotvec(jitter))
    recording = recording_of(rig, fps, rotations)
    cuts = find_cuts(recording)
    return Recorded(rest, gestures, mirror, made, recording, cuts, recorded_clips(recording, cuts))


def during(seen: Recorded, made: Made) -> list[Cut]:
    fps = seen.recording.fps
    return [c for c in seen.cuts if c.name != REST and made.begin < c.stroke / fps < made.end]


def mirrored_name(name: str) -> str:
    """Of the same gesture with the other hand: beat_left_2 for beat_right_2."""
    meant = meaning(name)
    return other_hand(meant) + name.removeprefix(meant)


def test_every_gesture_is_found_once_under_its_name(seen):
    found = {name: during(seen, made) for name, made in seen.made.items()}
    names = {name: [cut.name for cut in cuts] for name, cuts in found.items()}
    meant = {n: meaning(n) for n in seen.gestures}
    assert names == {n: [other_hand(m) if seen.mirror else m] for n, m in meant.items()}
    assert len(seen.cuts) == len(seen.gestures) + 1  # and a rest
    for name, (cut,) in found.items():
        wrists = {role[:-6] for role in seen.gestures[name].curves if role.endswith("_wrist")}
        if seen.mirror and len(wrists) == 1:
            wrists = set(SIDES) - wrists
        assert set(cut.sides) == wrists


def test_strokes_holds_and_ends_are_when_they_were_made(seen):
    for name, made in seen.made.items():
        (cut,) = during(seen, made)
        begin, stroke, release, end = (
            frame / seen.recording.fps for frame in (cut.first, cut.stroke, cut.release, cut.last)
        )
        assert made.begin <= begin + 0.07 and end - 0.07 <= made.end, name
        most = 0.3 if name in SLOW else 0.12
        assert abs(stroke - made.stroke) < most, name
        if cut.sides:
            assert abs(release - made.release) < max(most, 0.14), name
            assert stroke - begin > 0.3 and end - release > 0.3, name


def test_rest_is_where_hands_hang(seen):
    (cut,) = [cut for cut in seen.cuts if cut.name == REST]
    assert cut.last - cut.first > 2 * seen.recording.fps
    for made in seen.made.values():
        if during(seen, made)[0].sides:
            stroke = made.stroke * seen.recording.fps
            assert not cut.first <= stroke <= cut.last


def test_clips_have_the_pose_of_the_stroke(seen):
    most = 6.0 if seen.mirror else 1.7  # degrees; with jitter more
    for name, gesture in seen.gestures.items():
        if seen.mirror and name in SLOW:
            continue
        clip = seen.clips[mirrored_name(name) if seen.mirror else name]
        wanted = gesture.mirrored() if seen.mirror else gesture
        for role in set(clip.curves) & set(wanted.curves):
            poses = (c.curves[role].at(c.marks.stroke) for c in (clip, wanted))
            assert angles(*poses) < most, (name, role)


def test_clips_begin_and_end_with_hanging_arms_and_are_smooth(seen):
    hung = hung_in(seen.recording, seen.cuts)
    assert angles(hung, seen.rest.hung).max() < 5.0  # the living rest moves a little
    for name, clip in seen.clips.items():
        poses = clip.at(np.arange(0, clip.marks.end, 0.01))
        fastest = angles(poses[:-1], poses[1:]).max() / 0.01
        assert fastest < 1000, name
        arms = [i for i, role in enumerate(clip.roles) if "_" in list(INDEX)[role]]
        ends = clip.at(np.array([0.0, clip.marks.end]))[:, arms]
        if arms:
            assert angles(ends, hung[clip.roles[arms]]).max() < 16.0, name


def test_a_wave_goes_round_without_a_jump_and_other_strokes_stay(seen):
    for name, clip in seen.clips.items():
        hold = clip.at(np.array([clip.marks.hold, clip.marks.release]))
        assert angles(hold[0], hold[1]).max() < 1.1, name
        assert (clip.cycle > 0) == (name == "wave")


def test_feet_stay_while_clips_are_made(seen):
    performer = Performer(seen.rest, seen.clips)
    now = 0.5
    for number, (name, clip) in enumerate(seen.clips.items()):
        performer.follow([Cue(number, name, False, now, now + clip.marks.stroke)])
        now += 1.0
    times = np.arange(0, now, 0.1)
    places = seen.rest.person.posed(*performer.at(times))
    for side in SIDES:
        assert np.ptp(places[f"{side}_ankle"], axis=0).max() < 0.005
    moved = {role for clip in seen.clips.values() for role in clip.curves}
    assert not any("hip" in role or "knee" in role or "ankle" in role for role in moved)


def test_clips_come_back_from_a_file(seen):
    again = from_bytes(to_bytes(seen.clips))
    assert list(again) == list(seen.clips) and len(to_bytes(seen.clips)) < 220_000
    clip, other = seen.clips["wave"], again["wave"]
    assert angles(clip.at(0.5), other.at(0.5)).max() < 0.01


def test_a_body_that_stands_still_has_a_rest_and_no_clips():
    rest = living(rig_of("SMPL-X", 0.0), 1)
    by_role, _ = rest.at(np.arange(75) / 15)
    recording = recording_of(rest.person.rig, 15.0, rest.person.retarget.pose(by_role))
    (cut,) = find_cuts(recording)
    assert cut.name == REST and recorded_clips(recording, [cut]) == {}
    np.testing.assert_array_equal(hung_in(recording, []), rest.hung)
    (short,) = find_cuts(recording_of(rest.person.rig, 15.0, recording_rotations(rest)[:20]))
    assert short.last < 20


def recording_rotations(rest: Living) -> np.ndarray:
    return rest.person.retarget.pose(rest.at(np.arange(75) / 15)[0])
