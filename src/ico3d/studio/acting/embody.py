"""Adds a moving body to a performance of the head."""

from dataclasses import replace

import numpy as np

from ico3d.errors import SettingsError
from ico3d.studio.acting.acting import pose
from ico3d.studio.acting.conversing import conversing
from ico3d.studio.acting.gestures import MOTIONS as ACTED
from ico3d.studio.acting.gestures import act
from ico3d.studio.acting.performance import Performance
from ico3d.studio.person.subject import Subject

MOTIONS = (*ACTED, "conversation")


def embodied(
    subject: Subject,
    acted: Performance,
    motion: str,
    fps: float,
    seed: int,
    clear: bool = False,
) -> Performance:
    """The performance with a body that moves and carries the head.

    Args:
        subject: A whole person.
        acted: Performance of the head alone.
        motion: What the body does, one of `MOTIONS`.
        fps: Frames per second.
        seed: Seed of the body's movements.
        clear: Whether hands keep away from hips and thighs; not in a `conversation`.

    Raises:
        SettingsError: If the person has no skeleton, or one without joints that the motion needs.
    """
    skeleton = subject.skeleton
    if skeleton is None:
        raise SettingsError(f"the subject {subject.name} has no joints: name an .npz file.")
    times = np.arange(len(acted.weights)) / fps
    if motion == "conversation":
        joints = conversing(skeleton, times, seed)
    else:
        joints = pose(skeleton, act(skeleton, motion, times, seed, clear))
    joints[..., :3, 3] += subject.head_in_world
    return replace(acted, joints=joints, world_from_head=joints[:, skeleton.index("head")])
