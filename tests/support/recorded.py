"""Recordings of people who make gestures, one after the other."""

from dataclasses import dataclass, replace

import numpy as np

from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.packing import packed_quats
from ico3d.motion.clip import Clip
from ico3d.motion.composing.cues import Cue, Release, end_of, rounded_release
from ico3d.motion.composing.performer import Performer
from ico3d.motion.gestures.hanging import hanging
from ico3d.motion.living import Living
from ico3d.motion.person import Person
from ico3d.rig.quaternions import Array
from ico3d.rig.rig import Rig
from support.bundles.random_skinned import random_skinned

APART = 1.0
"""Seconds before the first gesture, and after each one."""


@dataclass(frozen=True)
class Made:
    """When a gesture was made; seconds.

    Attributes:
        begin: Hands leave their rest.
        stroke: The stroke arrives.
        release: The hold is over.
        end: Hands are back.
    """

    begin: float
    stroke: float
    release: float
    end: float


def performed(
    rest: Living, clips: dict[str, Clip], fps: float, mirror: bool = False
) -> tuple[Array, dict[str, Made]]:
    """Somebody who makes all gestures as a conversation would have it, living rest and all.

    Returns:
        Rotations (F, J, 4) of their rig, and when each gesture was made.
    """
    performer, now = Performer(rest, clips), APART
    found: dict[str, Made] = {}
    for number, (name, clip) in enumerate(clips.items()):
        cue = Cue(number, name, mirror, now, now + clip.marks.stroke)
        hold = clip.marks.release - clip.marks.hold
        release = Release(number, rounded_release(clip, cue, cue.stroke + hold))
        performer.follow([cue, release])
        end = end_of(clip, release.time)
        found[name] = Made(now, cue.stroke, release.time, end)
        now = end + APART
    by_role, _ = performer.at(np.arange(int(now * fps)) / fps)
    return rest.person.retarget.pose(by_role), found


def made_still(person: Person, clip: Clip, fps: float) -> Array:
    """(F, J, 4): somebody who moves nothing but what the gesture does, with arms that hang."""
    frames = int((clip.marks.end + 2 * APART) * fps)
    times = np.clip(np.arange(frames) / fps - APART, 0, clip.marks.end)
    by_role = np.tile(hanging(person), (frames, 1, 1))
    by_role[:, clip.roles] = clip.at(times)
    return person.retarget.pose(by_role)


def body_of(rig: Rig, fps: float, rotations: Array, roots: Array, count: int) -> BakedSkinned:
    """Random Gaussians along the bones of somebody who was recorded.

    Args:
        rig: J joints.
        fps: Frames per second.
        rotations: (F, J, 4) wxyz of each joint about itself.
        roots: (F, 3) metres that the root moves from rest.
        count: N.
    """
    random, drawn = np.random.default_rng(2), random_skinned(count, frames=len(rotations))
    joints = rig.joints.astype(np.float32)
    bone = random.integers(0, len(rig), count)
    info = replace(
        drawn.info,
        fps=fps,
        names=rig.names,
        parents=rig.parents,
        num_moving=len(rig),
        low=(-1.0, -0.1, -1.5),
        high=(1.5, 2.0, 1.0),
    )
    return replace(
        drawn,
        info=info,
        means=(joints[bone] + random.normal(0, 0.03, (count, 3))).astype(np.float32),
        joints=np.tile(bone[:, None], (1, 4)).astype(np.uint8),
        shape_scales=drawn.shape_scales * np.float16(0.01),
        rig_joints=joints,
        held=packed_quats(rotations[0]),
        moving=np.arange(len(rig), dtype=np.uint8),
        rotations=packed_quats(rotations),
        roots=roots.astype(np.float32),
    )
