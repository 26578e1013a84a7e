"""Cuts of very short recordings, and clips made of cuts that somebody edited."""

import numpy as np

from ico3d.motion.composing.cues import Cue
from ico3d.motion.composing.performer import Performer
from ico3d.motion.living import living
from ico3d.motion.recorded.cut import Cut, from_toml, to_toml
from ico3d.motion.recorded.cutting import find_cuts
from ico3d.motion.recorded.making import recorded_clips
from ico3d.motion.recorded.recording import Recording
from ico3d.motion.roles import INDEX
from ico3d.rig.quaternions import IDENTITY, from_rotvec
from support.rigs import rig_of


def test_a_nod_whose_stroke_is_at_its_first_frame_takes_time_to_arrive():
    rest = living(rig_of("SMPL-X", 0.0), 0)
    poses = np.tile(IDENTITY, (12, len(INDEX), 1))  # (F, R, 4)
    poses[3:6, INDEX["head"]] = from_rotvec(np.array([0.3, 0.0, 0.0]))
    recording = Recording(rest.person, 15.0, poses)
    clips = recorded_clips(recording, [Cut("nod", "none", 3, 3, 5, 9)])
    stroke = clips["nod"].marks.stroke
    assert stroke > 0
    performer = Performer(rest, clips)
    performer.follow([Cue(0, "nod", False, 1.0, 1.0 + stroke)])
    by_role, root = performer.at(np.array([1.0, 1.2]))
    assert np.isfinite(by_role).all() and np.isfinite(root).all()


def test_a_rest_lasts_two_frames_at_least():
    """Of one frame it would be refused when it is read again."""
    rest = living(rig_of("SMPL-X", 0.0), 0)
    for frames in (1, 2):
        still = Recording(rest.person, 1.0, np.tile(rest.hung, (frames, 1, 1)))
        cuts = find_cuts(still)
        assert len(cuts) == frames - 1
        text = to_toml(cuts, 1.0, frames)
        assert from_toml(text.encode(), "clips.toml", 1.0, frames) == tuple(cuts)
