"""Body tracks that nobody has to fit: the skeleton and the mesh that made a synthetic recording."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.rig import quaternions
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.rig import Rig
from ico3d.studio.acting.embody import embodied
from ico3d.studio.acting.performance import perform
from ico3d.studio.person.choice import load_subject


def true_track(recording: Path, subject_file: Path) -> BodyTrack:
    """The track of a synthetic recording of a whole person.

    Args:
        recording: Its folder, which tells what was acted.
        subject_file: The person, an `.npz` file.
    """
    about = json.loads((recording / "capture.json").read_text())
    settings, fps = about["settings"], about["fps"]
    subject = load_subject(str(subject_file), whole=True)
    assert subject.name == settings["subject"] and subject.skeleton is not None
    frames, seed = settings["frames"], settings["seed"]
    acted = perform(subject, settings["text"], frames, fps, seed, settings["lively"])
    joints = embodied(subject, acted, settings["motion"], fps, seed).joints  # (F, J, 4, 4)
    assert joints is not None
    bones, shift = subject.skeleton, subject.head_in_world
    turned = joints[..., :3, :3]
    local = turned.copy()  # (F, J, 3, 3)
    for joint, parent in enumerate(bones.parents):
        if parent >= 0:
            local[:, joint] = np.swapaxes(turned[:, parent], -1, -2) @ turned[:, joint]
    root = joints[:, 0, :3, :3] @ bones.at[0] + joints[:, 0, :3, 3]  # (F, 3)
    rig = Rig(bones.names, tuple(int(p) for p in bones.parents), bones.at + shift)
    return BodyTrack(
        rig,
        fps,
        quaternions.from_matrix(local).astype(np.float32),
        (root - rig.joints[0]).astype(np.float32),
        np.ones(frames, bool),
        (subject.vertices + shift).astype(np.float32),
        subject.faces,
        Binding.strongest(bones.weights),
        "the studio's own mesh",
    )


def noisy(track: BodyTrack, seed: int, degrees: float = 2.0, metres: float = 0.005) -> BodyTrack:
    """A track as if badly fitted: every joint of every frame turned by |N(0, degrees)|.

    Args:
        track: The true one.
        seed: Decides the errors.
        degrees: Of the half-normal angles, about random axes.
        metres: Standard deviation of the root's place along each axis.
    """
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(*track.rotations.shape[:2], 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)  # (F, J, 3)
    angles = np.radians(degrees) * np.abs(rng.normal(size=track.rotations.shape[:2]))
    turned = quaternions.multiply(
        quaternions.from_rotvec(axes * angles[..., None]), track.rotations
    )
    roots = track.roots + metres * rng.normal(size=track.roots.shape)
    return replace(track, rotations=turned.astype(np.float32), roots=roots.astype(np.float32))
