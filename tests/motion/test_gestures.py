"""The gestures of the package, on rigs of other proportions and rest poses."""

from dataclasses import dataclass

import numpy as np
import pytest

from ico3d.motion.clearance import way_out_of_head, way_out_of_trunk
from ico3d.motion.clip import Clip, from_bytes, to_bytes
from ico3d.motion.composing.lexicon import lexicon
from ico3d.motion.gestures.hanging import hanging
from ico3d.motion.gestures.library import gesture
from ico3d.motion.gestures.scripts import SCRIPTS
from ico3d.motion.person import Person, person_of
from ico3d.motion.retarget import DOWN
from ico3d.motion.roles import INDEX, SIDES
from ico3d.motion.turning import twist_angle
from ico3d.rig.quaternions import conjugate, rotate
from support.rigs import gestures_of, rig_of

pytestmark = pytest.mark.slow
MOMENTS = 40
TOLERATED = 0.012
"""Metres that a hand may be inside the rounded solids that stand for the body."""
WRIST = 85.0
"""Degrees that a wrist is bent at most."""
TWIST = 110.0
"""Degrees that a forearm is turned from palm to thigh at most."""
FASTEST = 900.0
"""Degrees a second that a joint turns at most."""


@dataclass(frozen=True, eq=False)
class Made:
    """A person's gestures, and all of them at 40 moments each.

    Attributes:
        person: Who.
        clips: By name.
        names: (F,) of the gesture of each moment.
        poses: (F, R, 4) by role.
        places: (F, 3) where each role's joint is.
    """

    person: Person
    clips: dict[str, Clip]
    names: np.ndarray
    poses: np.ndarray
    places: dict[str, np.ndarray]

    def as_carried(self, carrier: str, role: str) -> np.ndarray:
        """(F, 3) a role's joint in rest space, as another role carries it."""
        turned = self.person.retarget.world(self.poses)[:, INDEX[carrier]]
        offset = self.places[role] - self.places[carrier]
        return self.person.place(carrier) + rotate(conjugate(turned), offset)


@pytest.fixture(scope="module", params=["A", "T"])
def made(request) -> Made:
    """Of a small person who rests in an A-pose, and a tall one in a T-pose."""
    about = {"A": ("MakeHuman", 45.0, 35.0, 0.92), "T": ("SMPL-X", 0.0)}[request.param]
    person, clips = person_of(rig_of(*about)), gestures_of(*about)
    poses = [
        posed(person, clip, np.linspace(0, clip.marks.end, MOMENTS)) for clip in clips.values()
    ]
    stacked = np.concatenate(poses)
    names = np.repeat(list(clips), MOMENTS)
    return Made(person, clips, names, stacked, person.posed(stacked, np.zeros(3)))


def posed(person: Person, clip: Clip, times: np.ndarray) -> np.ndarray:
    """(T, R, 4) of a clip on hanging arms."""
    found = np.tile(hanging(person), (len(times), 1, 1))
    found[:, clip.roles] = clip.at(times)
    return found


def test_hands_stay_outside_of_the_body(made):
    radius = made.person.thickness.arm * made.person.height
    for side in SIDES:
        for role, thick in ((f"{side}_wrist", radius), (f"{side}_middle2", 0.3 * radius)):
            for carrier, way_out in (("chest", way_out_of_trunk), ("head", way_out_of_head)):
                points = made.as_carried(carrier, role)
                inside = np.linalg.norm(way_out(made.person, points, thick), axis=-1)
                assert inside.max() < TOLERATED, (made.names[inside.argmax()], role, carrier)


def test_hands_do_not_cross(made):
    for part in ("wrist", "middle2"):
        apart = np.linalg.norm(made.places[f"left_{part}"] - made.places[f"right_{part}"], axis=-1)
        assert apart.min() > 0.06, (made.names[apart.argmin()], part)


def test_wrists_and_forearms_turn_as_far_as_people_s(made):
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        wrist = made.poses[:, INDEX[f"{side}_wrist"]]
        bend = np.degrees(2 * np.arccos(np.clip(np.abs(wrist[:, 0]), 0, 1)))
        assert bend.max() < WRIST, made.names[bend.argmax()]
        twist = sign * np.degrees(twist_angle(made.poses[:, INDEX[f"{side}_elbow"]], DOWN))
        assert twist.min() > -TWIST, made.names[twist.argmin()]
        assert twist.max() < TWIST, made.names[twist.argmax()]


def test_motion_is_smooth_and_begins_and_ends_with_hanging_arms(made):
    person, clips = made.person, made.clips
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
    person, clips = made.person, made.clips

    def at_stroke(name: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        clip = clips[name]
        pose = posed(person, clip, np.array([clip.marks.stroke]))
        places = person.posed(pose, np.zeros(3))
        return pose[0], {role: place[0] for role, place in places.items()}

    pose, places = at_stroke("think")
    chin = person.carried("head", person.chin, person.retarget.pose(pose), np.zeros(3))
    assert np.linalg.norm(places["right_index3"] - chin) < 0.09
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


def test_the_right_one_of_two_hands_leads_and_neither_is_the_other_s_mirror_image(made):
    person, clips = made.person, made.clips
    for name in ("open_hands", "beat_both", "beat_both_2", "welcome", "big", "small"):
        clip = clips[name]
        stroke = clip.marks.stroke
        places = person.posed(posed(person, clip, np.array([stroke - 0.12, stroke])), np.zeros(3))
        sides = [places[f"{side}_wrist"] for side in ("right", "left")]
        ahead, behind = (np.linalg.norm(wrist[1] - wrist[0]) for wrist in sides)
        assert ahead < 0.7 * behind, name  # the right one has less of its way left
        assert 0.02 < sides[0][1, 1] - sides[1][1, 1] < 0.15, name


def test_a_head_nods_down_and_shakes_to_the_side(made):
    person, clips = made.person, made.clips
    for name, axis in (("nod", 1), ("shake", 0)):
        clip = clips[name]
        pose = posed(person, clip, np.array([0.0, clip.marks.stroke]))
        looks = rotate(person.retarget.world(pose)[:, INDEX["head"]], np.array([0.0, 0.0, 1.0]))
        assert looks[1, axis] - looks[0, axis] < -0.1


def test_every_gesture_that_words_call_for_is_there_and_files_hold_all(made):
    clips = made.clips
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
