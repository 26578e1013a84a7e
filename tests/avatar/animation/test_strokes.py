"""Somebody on a skeleton whose file of gestures holds none: there is nothing to show."""

import numpy as np

from ico3d.avatar.animation.strokes import filled, strokes
from ico3d.avatar.poseable import Poseable
from ico3d.motion.composing.composer import Composer
from ico3d.motion.living import living
from ico3d.motion.repertoire import clips_for, repertoire_bytes
from support.rigs import rig_of
from support.spoken import speech


def test_somebody_without_gestures_stands_and_talks():
    rig = rig_of("SMPL-X", 0.0)
    rest = living(rig, 0)
    clips = clips_for(repertoire_bytes(rest, {}), rig)
    person = Poseable(rest, (rest.hung, np.zeros(3)), lambda *pose: None, None, clips)  # type: ignore
    assert list(strokes(person, np.zeros(0))) == []
    assert filled(person, np.zeros(0)).shape == (0, 3)
    composer = Composer(clips, 0)
    composer.know(*speech(0))
    composer.end(60.0)
    assert composer.directions(float("inf")) == []
