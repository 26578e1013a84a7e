"""A person who makes the gestures of the package, recorded for an avatar that is to make them.

In poses that nobody recorded, an avatar's folds, shades and fingers are guesses. Gestures are not
played at their pace: all frames lie where hands do something, from when they rise to when they
sink again.
"""

import numpy as np

from ico3d.motion.composing.cues import Cue, Release
from ico3d.motion.composing.performer import Performer
from ico3d.motion.gestures.library import library
from ico3d.motion.living import living
from ico3d.rig.quaternions import to_matrix
from ico3d.rig.rig import Rig
from ico3d.studio.acting.acting import pose
from ico3d.studio.acting.gestures import act
from ico3d.studio.person.skeleton import Skeleton

CONVERSING = 0.45
"""Share of the time for gestures; in the rest of it, the person does what `repertoire` tells."""
RISEN, SUNK = 0.55, 0.25
"""How much of the preparation is over when a gesture's frames begin, and of the retraction when
they end."""


def conversing(skeleton: Skeleton, times: np.ndarray, seed: int) -> np.ndarray:
    """The joints of a person who makes all gestures, then goes through the repertoire.

    Args:
        skeleton: Skeleton of the person.
        times: (F,) seconds, ascending from 0.
        seed: Seed of all small movements.

    Returns:
        (F, J, 4, 4) float64 transforms from the rest pose to the posed body, both in canonical head
        space at rest.

    Raises:
        SettingsError: If the skeleton lacks joints that gestures need.
    """
    split = int(np.ceil(CONVERSING * len(times)))
    first = _gesturing(skeleton, split, seed)
    if split == len(times):
        return first
    rest = times[split:] - times[split]
    return np.concatenate([first, pose(skeleton, act(skeleton, "repertoire", rest, seed))])


def _gesturing(skeleton: Skeleton, frames: int, seed: int) -> np.ndarray:
    """(F, J, 4, 4) joints in frames that are spread evenly over all gestures."""
    rig = Rig(skeleton.names, tuple(map(int, skeleton.parents)), skeleton.at)
    rest = living(rig, seed)
    clips = library(rest.person, hung=rest.hung)
    performer = Performer(rest, clips)
    begins = []  # of what is shown of each gesture, seconds
    lengths = []
    now = 0.0
    for number, (name, clip) in enumerate(clips.items()):
        marks = clip.marks
        cue = Cue(number, name, False, now, now + marks.stroke)
        performer.follow([cue, Release(number, now + marks.release)])
        begins.append(now + RISEN * marks.ready)
        lengths.append(marks.release + SUNK * (marks.end - marks.release) - RISEN * marks.ready)
        now += marks.end
    until = np.cumsum(lengths)
    shown = (np.arange(frames) + 0.5) / frames * until[-1]  # (F,)
    number = np.searchsorted(until, shown, side="right")
    by_role, root = performer.at(np.array(begins)[number] + shown - (until - lengths)[number])
    rotations = to_matrix(rest.person.retarget.pose(by_role))  # (F, J, 3, 3)
    return skeleton.matrices(rotations, root)
