"""What a page gets to move somebody: a figure that belongs to the rig, and gestures."""

import json
from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load, save

from ico3d.errors import SettingsError
from ico3d.motion.clip import Clip, Marks, to_bytes
from ico3d.motion.composing.cues import Cue, Release
from ico3d.motion.composing.performer import Performer
from ico3d.motion.curves import Curve
from ico3d.motion.figure import alike, figure_of
from ico3d.motion.living import living
from ico3d.motion.repertoire import clips_for, hung_of, preferring, repertoire_bytes
from ico3d.motion.roles import ROLES
from ico3d.motion.standing import APART_BEFORE, stance_of
from ico3d.rig.quaternions import IDENTITY, from_rotvec, multiply
from ico3d.rig.rig import Rig
from support.rigs import rig_of

KEYS = from_rotvec(np.array([[0.0, 0, 0], [0.3, 0, 0]]))
CLIPS = {
    "nod": Clip("nod", Marks(0.1, 0.2, 0.2, 0.2, 0.5), {"head": Curve(np.array([0, 0.5]), KEYS)})
}


@pytest.fixture(scope="module")
def rig() -> Rig:
    return rig_of("MakeHuman", 45.0)


@pytest.fixture(scope="module")
def content(rig) -> bytes:
    return repertoire_bytes(living(rig, 3), CLIPS)


def test_gestures_come_back_for_the_rig_and_for_its_rounded_joints(rig, content):
    rounded = Rig(rig.names, rig.parents, rig.joints.astype(np.float32).astype(float))
    for one in (rig, rounded):
        nod = clips_for(content, one)["nod"]
        assert nod.marks == CLIPS["nod"].marks
        np.testing.assert_allclose(nod.curves["head"].rotations, KEYS, atol=1e-4)


def test_another_rig_is_refused(rig, content):
    taller = Rig(rig.names, rig.parents, 1.01 * rig.joints)
    for other in (taller, rig_of("MakeHuman", 40.0), rig_of("SMPL-X", 45.0)):
        with pytest.raises(SettingsError, match="another rig"):
            clips_for(content, other)


def test_where_people_stood_in_files_of_earlier_versions_is_taken(rig):
    somebody = living(rig, 3)
    for apart, taken in ((APART_BEFORE, True), (1.1, False)):
        stood = replace(somebody, stance=stance_of(somebody.person, apart))
        content = repertoire_bytes(stood, CLIPS)
        if taken:
            assert set(clips_for(content, rig)) == set(CLIPS)
        else:
            with pytest.raises(SettingsError, match="another rig"):
                clips_for(content, rig)


@pytest.mark.parametrize("figure", [None, "", "[", '{"height": NaN}'])
def test_a_file_without_a_figure_is_refused(rig, content, figure):
    header = {"clips": clips_header(content)}
    damaged = save(load(content), header if figure is None else {**header, "figure": figure})
    with pytest.raises(SettingsError, match="tells no figure"):
        clips_for(damaged, rig)
    with pytest.raises(SettingsError, match="damaged"):
        clips_for(content[:100], rig)
    with pytest.raises(SettingsError, match="tells no figure"):
        clips_for(to_bytes(CLIPS), rig)


def clips_header(content: bytes) -> str:
    size = int.from_bytes(content[:8], "little")
    return json.loads(content[8 : 8 + size])["__metadata__"]["clips"]


def test_a_figure_is_of_everybody_the_rig_has_roles_for(rig):
    figure = figure_of(living(rig, 0))
    assert [part["role"] for part in figure["parts"]] == list(ROLES)
    by_role = {part["role"]: part for part in figure["parts"]}
    joints = sorted(joint for part in figure["parts"] for joint in part["joints"])
    assert joints == list(range(len(rig)))
    assert by_role["left_shoulder"]["shares"] == [0.5, 0.5]
    np.testing.assert_allclose(by_role["hips"]["standard"], IDENTITY)
    elbow, shoulder = (
        rig.joints[by_role[f"left_{part}"]["joints"][0]] for part in ("elbow", "shoulder")
    )
    axis = np.array(by_role["left_shoulder"]["axes"][0])
    np.testing.assert_allclose(axis, (elbow - shoulder) / np.linalg.norm(elbow - shoulder))
    knee = rig.joints[by_role["right_knee"]["joints"][0]]
    assert np.linalg.norm(knee - figure["legs"]["right"]["hip"]) == pytest.approx(
        figure["legs"]["right"]["lengths"][0]
    )


def test_figures_differ_by_more_than_rounding():
    assert alike({"a": [1.0, None, [2]]}, {"a": [1.0 + 1e-9, None, [2]]})
    for other in ({"a": [1.1, None, [2]]}, {"a": [1.0, None]}, {"b": []}, {"a": [1.0, 0.5, [2]]}):
        assert not alike({"a": [1.0, None, [2]]}, other)


def test_arms_hang_as_the_file_says(rig):
    turn = from_rotvec(np.array([0.2, 0.0, 0.0]))
    hung = multiply(turn, living(rig, 3).hung)
    content = repertoire_bytes(living(rig, 3, hung), CLIPS)
    np.testing.assert_allclose(hung_of(content), hung, atol=1e-12)
    assert set(clips_for(content, rig)) == set(CLIPS)
    np.testing.assert_allclose(living(rig, 3, hung).hung, hung)


@pytest.mark.parametrize("hung", [None, [[1, 0, 0, 0]], [[2, 0, 0, 0]] * len(ROLES), "no", [[]]])
def test_arms_that_hang_in_no_rotations_are_refused(rig, content, hung):
    size = int.from_bytes(content[:8], "little")
    about = json.loads(content[8 : 8 + size])["__metadata__"]
    about["figure"] = json.dumps({**json.loads(about["figure"]), "hung": hung})
    with pytest.raises(SettingsError, match="does not say how arms hang"):
        clips_for(save(load(content), about), rig)


def test_a_recorded_gesture_replaces_all_takes_of_the_package():
    nod = CLIPS["nod"]
    others = {"nod": nod, "nod_2": nod, "beat_left": nod, "beat_left_2": nod, "wave": nod}
    assert set(preferring({"nod": nod, "beat_right": nod}, others)) == {"nod", "beat_right", "wave"}


def test_a_stranger_s_gesture_that_moves_nothing_is_shown_as_nothing(rig):
    still = Clip("nod", Marks(0.1, 0.2, 0.2, 0.2, 0.5), {})
    somebody = living(rig, 3)
    performer = Performer(somebody, {"nod": still})
    performer.follow([Cue(0, "nod", True, 0.0, 0.2), Release(0, 0.3)])
    np.testing.assert_allclose(performer.at(0.2)[0][0], somebody.at(0.2)[0], atol=1e-12)
