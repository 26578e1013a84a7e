"""Gestures one after the other, and where somebody stands who makes them."""

import numpy as np
import pytest

from ico3d.errors import SettingsError
from ico3d.motion.composing.cues import Cue, Release
from ico3d.motion.composing.in_turn import BEGIN, PAUSE, in_turn
from ico3d.motion.composing.performer import Performer
from ico3d.motion.footing import footing
from ico3d.motion.gestures.library import library
from ico3d.motion.living import living
from ico3d.motion.turning import about
from ico3d.rig.quaternions import multiply, rotate
from support.rigs import rig_of


@pytest.fixture(scope="module")
def rest():
    return living(rig_of("SMPL-X"), 7)


def test_each_has_its_own_time(rest):
    """Hands hang between two gestures, also where the same comes again."""
    clips = library(rest.person, ("nod", "beat_right"))
    directions, seconds = in_turn(clips, ("beat_right", "nod", "beat_right"))
    cues = [one for one in directions if isinstance(one, Cue)]
    releases = {one.number: one.time for one in directions if isinstance(one, Release)}
    assert [cue.name for cue in cues] == ["beat_right", "nod", "beat_right"]
    assert cues[0].begin == BEGIN
    ends = [
        releases[c.number] + clips[c.name].marks.end - clips[c.name].marks.release for c in cues
    ]
    assert [cue.begin for cue in cues[1:]] == pytest.approx([end + PAUSE for end in ends[:-1]])
    assert seconds == pytest.approx(ends[-1] + PAUSE)
    performer = Performer(rest, clips)
    performer.follow(directions)
    between = np.array([0.5 * PAUSE + end for end in ends])
    np.testing.assert_array_equal(performer.at(between)[0], rest.at(between)[0])


def test_what_nobody_knows_is_refused(rest):
    clips = library(rest.person, ("nod",))
    with pytest.raises(SettingsError, match="there is no gesture 'juggle': there are nod"):
        in_turn(clips, ("nod", "juggle"))
    with pytest.raises(SettingsError, match=r"there is no gesture 'nod': there are none\.$"):
        in_turn({}, ("nod",))


def test_feet_stand_where_they_were_recorded(rest):
    """Turned as the hips were, on the same spot."""
    rig, joints = rest.person.rig, rest.person.cast.joints
    by_role, root = rest.at(3.0)
    stands = rest.person.retarget.pose(by_role)
    recorded = stands.copy()
    recorded[0] = multiply(about(np.array([0.0, 1, 0]), 0.7), recorded[0])
    moved = root + np.array([2.0, 0.1, -1.0])
    rotations, shift = footing(rest, recorded, moved).place(stands, root)
    ankles = [joints[f"{side}_ankle"][-1] for side in ("left", "right")]
    expected = rig.posed(recorded, moved)[1][ankles].mean(0)
    np.testing.assert_allclose(rig.posed(rotations, shift)[1][ankles].mean(0), expected, atol=1e-9)
    across = rotate(rotations[0], np.array([1.0, 0, 0]))
    was = rotate(recorded[0], np.array([1.0, 0, 0]))
    assert np.arctan2(-across[2], across[0]) == pytest.approx(np.arctan2(-was[2], was[0]), abs=0.05)
