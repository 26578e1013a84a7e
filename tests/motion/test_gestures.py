"""The gestures of the package, on rigs of other proportions and rest poses."""

import numpy as np
import pytest

from ico3d.motion.clearance import way_out_of_head, way_out_of_trunk
from ico3d.motion.clip import Clip, from_bytes, to_bytes
from ico3d.motion.composing.lexicon import lexicon
from ico3d.motion.gestures.hanging import hanging
from ico3d.motion.gestures.library import gesture, library
from ico3d.motion.gestures.scripts import SCRIPTS
from ico3d.motion.person import Person, person_of
from ico3d.motion.retarget import DOWN
from ico3d.motion.roles import INDEX, SIDES
from ico3d.motion.turning import twist_angle
from ico3d.rig.quaternions import conjugate, rotate
from support.rigs import rig_of

pytestmark = pytest.mark.slow
TOLERATED = 0.012
"""Metres that a hand may be inside the rounded solids that stand for the body."""
WRIST = 85.0
"""Degrees that a wrist is bent at most."""
FASTEST = 900.0
"""Degrees a second that a joint turns at most."""


@pytest.fixture(scope="module", params=["A", "T"])
def made(request) -> tuple[Person, dict[str, Clip]]:
    """A person and their gestures: a small one who rests in an A-pose, a tall one in a T-pose."""
    rig = {"A": lambda: rig_of("MakeHuman", 45.0, 35.0, 0.92), "T": lambda: rig_of("SMPL-X", 0.0)}
    person = person_of(rig[request.param]())
    return person, library(person)


def poses(person: Person, clip: Clip, times: np.ndarray) -> np.ndarray:
    """(T, R, 4) of a clip on hanging arms."""
    found = np.tile(hanging(person), (len(times), 1, 1))
    found[:, clip.roles] = clip.at(times)
    return found


def in_chest(person: Person, pose: np.ndarray, role: str) -> np.ndarray:
    """(T, 3) where a role's joint is, as the chest sees it, in rest space."""
    place = person.posed(pose, np.zeros(3))[role]
    rotations = person.retarget.pose(pose)
    origin = person.carried("chest", np.zeros(3), rotations, np.zeros(3))
    return rotate(conjugate(person.retarget.world(pose)[:, INDEX["chest"]]), place - origin)


def test_hands_stay_outside_of_the_body(made):
    person, clips = made
    radius = person.thickness.arm * person.height
    for clip in clips.values():
        pose = poses(person, clip, np.linspace(0, clip.marks.end, 40))
        for side in SIDES:
            for role, thick in ((f"{side}_wrist", radius), (f"{side}_middle2", 0.3 * radius)):
                points = in_chest(person, pose, role)
                for way_out in (way_out_of_trunk, way_out_of_head):
                    inside = np.linalg.norm(way_out(person, points, thick), axis=-1)
                    assert inside.max() < TOLERATED, (clip.name, role)


def test_hands_keep_to_their_own_side_or_far_from_one_another(made):
    person, clips = made
    for clip in clips.values():
        pose = poses(person, clip, np.linspace(0, clip.marks.end, 40))
        places = person.posed(pose, np.zeros(3))
        for part in ("wrist", "middle2"):
            apart = np.linalg.norm(places[f"left_{part}"] - places[f"right_{part}"], axis=-1)
            assert apart.min() > 0.06, (clip.name, part)


def test_wrists_and_forearms_turn_as_far_as_people_s(made):
    person, clips = made
    for clip in clips.values():
        pose = poses(person, clip, np.linspace(0, clip.marks.end, 60))
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            bend = 2 * np.arccos(np.clip(np.abs(pose[:, INDEX[f"{side}_wrist"], 0]), 0, 1))
            assert np.degrees(bend).max() < WRIST, clip.name
            twist = sign * np.degrees(twist_angle(pose[:, INDEX[f"{side}_elbow"]], DOWN))
            assert twist.min() > -110 and twist.max() < 110, (clip.name, twist.min(), twist.max())


def test_motion_is_smooth_and_begins_and_ends_with_hanging_arms(made):
    person, clips = made
    hung = hanging(person)
    for clip in clips.values():
        times = np.arange(0, clip.marks.end, 0.01)
        found = clip.at(times)  # (T, M, 4)
        step = np.abs((found[1:] * found[:-1]).sum(-1)).clip(0, 1)
        assert np.degrees(2 * np.arccos(step)).max() / 0.01 < FASTEST, clip.name
        for end in (0.0, clip.marks.end):
            same = np.abs((clip.at(end) * hung[clip.roles]).sum(-1))
            assert np.degrees(2 * np.arccos(same.clip(0, 1))).max() < 1.5, clip.name


def test_hands_go_where_they_are_meant_to(made):
    person, clips = made

    def at_stroke(name: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        clip = clips[name]
        pose = poses(person, clip, np.array([clip.marks.stroke]))
        places = person.posed(pose, np.zeros(3))
        return pose[0], {role: place[0] for role, place in places.items()}

    pose, places = at_stroke("think")
    chin = person.carried("head", person.chin, person.retarget.pose(pose), np.zeros(3))
    assert np.linalg.norm(places["right_index2"] - chin) < 0.08
    _, places = at_stroke("hand_on_heart")
    assert np.linalg.norm(places["right_middle1"] - person.chest) < 0.08
    _, places = at_stroke("wave")
    assert places["right_wrist"][1] > places["right_shoulder"][1]
    assert places["left_wrist"][1] < person.place("hips")[1] + 0.1
    _, places = at_stroke("point")
    along = places["right_index2"] - places["right_index1"]
    assert along[2] / np.linalg.norm(along) > 0.95
    for name, straight in (("count_one", 1), ("count_two", 2), ("count_three", 3)):
        _, places = at_stroke(name)
        up = [
            places[f"right_{finger}3"][1] - places[f"right_{finger}1"][1]
            for finger in ("index", "middle", "ring", "little")
        ]
        assert sum(rise > 0.02 for rise in up) == straight, name
    _, places = at_stroke("shrug")
    _, still = at_stroke("nod")
    for side in SIDES:
        assert places[f"{side}_shoulder"][1] - still[f"{side}_shoulder"][1] > 0.02
    _, places = at_stroke("big")
    assert places["left_wrist"][0] - places["right_wrist"][0] > 0.6


def test_a_head_nods_down_and_shakes_to_the_side(made):
    person, clips = made
    for name, axis in (("nod", 1), ("shake", 0)):
        clip = clips[name]
        pose = poses(person, clip, np.array([0.0, clip.marks.stroke]))
        looks = rotate(person.retarget.world(pose)[:, INDEX["head"]], np.array([0.0, 0.0, 1.0]))
        assert looks[1, axis] - looks[0, axis] < -0.1


def test_every_gesture_that_words_call_for_is_there_and_files_hold_all(made):
    _, clips = made
    known = lexicon()
    called = set(known.words.values()) | {g for _, g in (*known.phrases, *known.requests)}
    assert called <= set(clips) == set(SCRIPTS)
    assert len(to_bytes(clips)) < 200_000
    assert list(from_bytes(to_bytes(clips))) == list(clips)


def test_a_person_who_is_larger_gestures_in_proportion():
    turned = []
    for scale in (1.0, 1.2):
        person = person_of(rig_of("MakeHuman", 45.0, 35.0, scale))
        turned.append(gesture(person, "wave", SCRIPTS["wave"], hanging(person)).at(0.94))
    np.testing.assert_allclose(np.abs((turned[0] * turned[1]).sum(-1)), 1, atol=2e-4)
