"""A whole person on a skeleton, recorded waving, away from the origin and turned aside.

Run: python acting_person.py OUT

Writes OUT/person.ico3d, and its files into OUT/bundle: random Gaussians along the bones of a rig,
and a random head on it.
"""

import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.avatar.baking.persona import load_persona
from ico3d.bundle.animation import Action, Animation, Rest
from ico3d.bundle.format import ANIMATION, write_bundle
from ico3d.bundle.head import POSES, poses_to_bytes
from ico3d.bundle.manifest import GazeInfo
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.gestures import gesture_files
from ico3d.bundle.skinned.info import SKINNED
from ico3d.motion.gestures.library import library
from ico3d.motion.person import person_of
from ico3d.rig.quaternions import multiply, to_matrix
from support.bundles.random_bundle import random_files, random_head, random_manifest, thumbnail
from support.bundles.random_skinned import skinned_manifest
from support.recorded import body_of, made_still
from support.rigs import rig_of

GAUSSIANS, FPS = 900, 15.0
YAW = 0.5
"""Radians by which the person was turned to its left when recorded."""
PLACE = np.array([0.4, 0.0, -0.3])
"""Metres from the origin."""
GAZE = GazeInfo((0.0, 0.03, 0.06), (0.2, 0.1))
"""The two displacements of a random head are its eyes'."""
PERSONA = Path(__file__).parents[1] / "persona.json"


def recorded_body() -> BakedSkinned:
    """Somebody who stands still, then waves with the left hand."""
    rig = rig_of("SMPL-X", 0.0)
    person = person_of(rig)
    (wave,) = library(person, ("wave",)).values()
    rotations = made_still(person, wave.mirrored(), FPS)  # (F, J, 4)
    turned = np.array([np.cos(YAW / 2), 0, np.sin(YAW / 2), 0])
    rotations[:, 0] = multiply(turned, rotations[:, 0])
    root = to_matrix(turned) @ rig.joints[0] + PLACE - rig.joints[0]
    return body_of(rig, FPS, rotations, np.tile(root, (len(rotations), 1)), GAUSSIANS)


def main() -> None:
    """Does what the file's docstring says."""
    body, head = recorded_body(), random_head(300)
    frames, about = body.info.num_frames, random_manifest(head)
    assert about.head is not None
    poses = np.tile(np.eye(4, dtype=np.float32), (frames, 1, 1))  # (F, 4, 4)
    turn = to_matrix(np.array([np.cos(YAW / 2), 0, np.sin(YAW / 2), 0]))
    poses[:, :3, :3] = turn
    poses[:, :3, 3] = turn @ [0, 1.6, 0.05] + PLACE
    manifest = replace(
        skinned_manifest(body),
        persona=load_persona(PERSONA),
        head=replace(about.head, fps=FPS, num_poses=frames, gaze=GAZE),
        speech=about.speech,
    )
    animation = Animation(FPS, frames, Rest(0, 2), (Action(24, 0.9),))
    files = random_files(head) | gesture_files(body)
    files |= {SKINNED: body.to_bytes(), POSES: poses_to_bytes(poses)}
    files |= {ANIMATION: animation.to_bytes(), "thumbnail.png": thumbnail()}
    path = Path(sys.argv[1]) / "person.ico3d"
    write_bundle(path, manifest, files)
    with zipfile.ZipFile(path) as bundle:
        bundle.extractall(path.with_name("bundle"))


if __name__ == "__main__":
    main()
