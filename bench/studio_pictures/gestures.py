"""How much bundles look like the studio's person in the gestures of the package.

    python bench/studio_pictures/gestures.py human_face_f.npz A.ico3d B.ico3d --light soft

The person is drawn by the studio at the stroke of each gesture, in the pose that the first bundle
would take, and so is the body of each bundle. PSNR is over what is seen of the person but the face,
whose expression is another one. For bundles of which nobody has moved the skeleton since the
recording: of `bench/make_demo.py` those before `write_finished`.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tyro
from rich import print as say

from ico3d.avatar.poseable import Poseable, poseable_of
from ico3d.bundle.format import Bundle
from ico3d.cli import run_script
from ico3d.common.camera import Camera, look_at
from ico3d.motion.gestures.library import library
from ico3d.rig.quaternions import Array, to_matrix
from ico3d.splat.render import render
from ico3d.studio.choice import load_subject
from ico3d.studio.picture.lamps import STUDIOS
from ico3d.studio.studio import Studio

SIZE, GREY = 640, 0.6
AT, FIELD, DISTANCE = (0.0, 1.15, 0.0), 1.1, 2.8
"""What the camera looks at, height of what it sees there, and how far it is; metres."""
BESIDE, UNDER = 70, 0.05
"""Pixels beside the head from which on all counts, and metres under its joint."""
NODS = ("nod", "small_nod", "shake")
"""Gestures of the head alone."""


@dataclass(frozen=True)
class Gestures:
    """What to compare.

    Attributes:
        subject: The subject file with the body that was recorded.
        bundles: Whole people on skeletons, made of recordings of that subject.
        light: Light of these recordings, one of `STUDIOS`.
    """

    subject: tyro.conf.Positional[Path]
    bundles: tyro.conf.Positional[tuple[Path, ...]]
    light: str = "soft"

    def run(self) -> None:
        people = [poseable_of(Bundle.open(file), None) for file in self.bundles]
        first = people[0]
        assert first is not None, "the first bundle is nobody on a skeleton"
        subject = load_subject(str(self.subject), whole=True)
        studio = Studio(subject, STUDIOS[self.light])
        camera = _camera()
        hung = first.living.hung
        rows: list[list[float]] = []
        for name, clip in library(first.living.person, hung=hung).items():
            if name in NODS:
                continue
            by_role = hung.copy()
            by_role[clip.roles] = clip.at(clip.marks.stroke)
            person = first.living.person
            pose = first.footing.place(person.retarget.pose(by_role), np.zeros(3))
            truth, counts = _drawn(studio, camera, pose)
            rows.append([_psnr(one, camera, pose, truth, counts) for one in people if one])
            say(f"{name:15}", *(f"{value:.2f}" for value in rows[-1]))
        say("mean           ", *(f"{value:.2f}" for value in np.mean(rows, axis=0)))


def _camera() -> Camera:
    focal = SIZE * DISTANCE / FIELD
    lens = np.array([[focal, 0, SIZE / 2], [0, focal, SIZE / 2], [0, 0, 1.0]])
    target = np.array(AT)
    eye = target + DISTANCE * np.array([0.0, np.sin(0.087), np.cos(0.087)])
    return Camera(SIZE, SIZE, lens, look_at(eye, target), "gestures")


def _drawn(
    studio: Studio, camera: Camera, pose: tuple[Array, Array]
) -> tuple[np.ndarray, np.ndarray]:
    """The studio's picture (H, W, 3) of a pose before grey, and (H, W) bool what counts of it."""
    subject, bones = studio.subject, studio.subject.skeleton
    assert bones is not None  # whole
    joints = bones.matrices(to_matrix(pose[0])[None], pose[1][None])[0]  # (J, 4, 4)
    joints[:, :3, 3] += subject.head_in_world
    head: Array = joints[bones.index("head")]
    moved = np.einsum("ab,jbc->jac", np.linalg.inv(head), joints)
    vertices = bones.skinned(subject.vertices, moved)
    picture, seen = studio.picture(camera, studio.figure(vertices.astype(np.float32), head))
    place = camera.world_to_camera @ np.append(head[:3, 3] - (0, UNDER, 0), 1.0)
    column, row = (camera.intrinsics @ (place[:3] / place[2]))[:2]
    rows, columns = np.mgrid[:SIZE, :SIZE]
    counts = (seen > 0.5) & ((rows > row) | (np.abs(columns - column) > BESIDE))
    return picture + GREY * (1 - seen[..., None]), counts


@torch.no_grad()
def _psnr(
    person: Poseable,
    camera: Camera,
    pose: tuple[Array, Array],
    truth: np.ndarray,
    counts: np.ndarray,
) -> float:
    picture = render(person.body(*pose), [camera], torch.full((3,), GREY)).rgb[0].numpy()
    return float(-10 * np.log10(((picture - truth)[counts] ** 2).mean()))


if __name__ == "__main__":
    sys.exit(run_script(Gestures))
