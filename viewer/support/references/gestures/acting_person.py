"""A whole person on a skeleton that gestures, recorded away from the origin and turned aside.

Run: python acting_person.py OUT

Writes OUT/person.ico3d: random Gaussians along the bones of a rig, and a random head on it.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.avatar.baking.persona import load_persona
from ico3d.bundle.animation import Action, Animation, Rest
from ico3d.bundle.format import ANIMATION, write_bundle
from ico3d.bundle.head import POSES, poses_to_bytes
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.gestures import gesture_files
from ico3d.bundle.skinned.info import SKINNED
from ico3d.bundle.skinned.packing import packed_quats
from ico3d.rig.quaternions import to_matrix
from support.bundles.random_bundle import random_files, random_head, random_manifest, thumbnail
from support.bundles.random_skinned import random_skinned, skinned_manifest
from support.rigs import rig_of

FRAMES, GAUSSIANS = 6, 900
YAW = 0.5
"""Radians by which the person was turned to its left when recorded."""
PLACE = np.array([0.4, 0.0, -0.3])
"""Metres from the origin."""
PERSONA = Path(__file__).parents[1] / "persona.json"


def recorded_body() -> BakedSkinned:
    """Somebody who stands still."""
    rig, random = rig_of("SMPL-X", 0.0), np.random.default_rng(2)
    drawn = random_skinned(GAUSSIANS, frames=FRAMES)
    count = len(rig)
    joints = rig.joints.astype(np.float32)
    bone = random.integers(0, count, GAUSSIANS)
    turned = np.array([np.cos(YAW / 2), 0, np.sin(YAW / 2), 0])
    held = np.tile([1.0, 0, 0, 0], (count, 1))
    held[0] = turned
    pivot = to_matrix(turned) @ joints[0] + PLACE
    info = replace(
        drawn.info,
        names=rig.names,
        parents=rig.parents,
        num_moving=1,
        low=(-1.0, -0.1, -1.5),
        high=(1.5, 2.0, 1.0),
    )
    return replace(
        drawn,
        info=info,
        means=(joints[bone] + random.normal(0, 0.03, (GAUSSIANS, 3))).astype(np.float32),
        joints=np.tile(bone[:, None], (1, 4)).astype(np.uint8),
        shape_scales=drawn.shape_scales * np.float16(0.01),
        rig_joints=joints,
        held=packed_quats(held),
        moving=np.array([0], np.uint8),
        rotations=np.tile(packed_quats(turned[None]), (FRAMES, 1, 1)),
        roots=np.tile(pivot - joints[0], (FRAMES, 1)).astype(np.float32),
    )


def main() -> None:
    """Does what the file's docstring says."""
    body, head = recorded_body(), random_head(300)
    fps, about = body.info.fps, random_manifest(head)
    assert about.head is not None
    poses = np.tile(np.eye(4, dtype=np.float32), (FRAMES, 1, 1))  # (F, 4, 4)
    turn = to_matrix(np.array([np.cos(YAW / 2), 0, np.sin(YAW / 2), 0]))
    poses[:, :3, :3] = turn
    poses[:, :3, 3] = turn @ [0, 1.6, 0.05] + PLACE
    manifest = replace(
        skinned_manifest(body),
        persona=load_persona(PERSONA),
        head=replace(about.head, fps=fps, num_poses=FRAMES),
        speech=about.speech,
    )
    animation = Animation(fps, FRAMES, Rest(0, 2), (Action(4, 0.9),))
    files = random_files(head) | gesture_files(body)
    files |= {SKINNED: body.to_bytes(), POSES: poses_to_bytes(poses)}
    files |= {ANIMATION: animation.to_bytes(), "thumbnail.png": thumbnail()}
    write_bundle(Path(sys.argv[1]) / "person.ico3d", manifest, files)


if __name__ == "__main__":
    main()
