"""Builds the demo avatar that comes in the package, from a subject file to the bundle.

    python bench/make_demo.py human_face_f.npz --licences ICT-FaceKit-LICENSE.txt --work WORK

The same command goes on where it was stopped, at the next picture or from the latest checkpoint;
what WORK holds already is not made again, and the seed decides everything. Head and body are
recorded in one light, the head from near: docs/avatars.md, "The packaged avatar". The skeleton is
the studio's own, as a motion-capture suit would tell it. Look at WORK/check, WORK/strip.png
(recorded | exact | baked) and WORK/gestures.mp4 before shipping it.
"""

import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from demo.finishing import write_finished

from ico3d.avatar.embodying.builds.change import change_to
from ico3d.bundle.format import Bundle
from ico3d.bundle.head import HEAD_REST
from ico3d.bundle.packaged import FILE
from ico3d.bundle.skinned.info import SKINNED_REST
from ico3d.cli import run_script
from ico3d.common.files import write_atomic
from ico3d.motion.recorded.cut import CUTS, to_toml
from ico3d.rig.body_track import track_file, write_body_track
from ico3d.rig.rig import Rig
from ico3d.studio.choice import load_subject
from ico3d.studio.picture.lamps import STUDIOS
from ico3d.studio.rigs import cameras_of
from ico3d.studio.studio import Studio
from ico3d.studio.truth import true_track

MAX_BYTES, MAX_FIRST_BYTES = 12 << 20, 3 << 20
"""Most bytes of the bundle, and of what a page needs before it shows somebody."""
GESTURES = ("wave", "point", "open_hands", "shrug", "count_three", "nod", "shake", "think")
"""To look at: hands, armpits and neck in poses that nobody recorded."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
MAKER = "the authors of ico3d"
LIGHT = "soft"
"""What an arm shades in the recording stays dark in every pose: its shade should be faint."""
SLENDER = 0.8
"""How far the subject's body is on the way to MakeHuman's slender build: the files' shoulders and
sleeves are broad for their heads."""
TRIED = 2
"""Cameras whose pictures are timed before recording."""


@dataclass(frozen=True)
class Shot:
    """One of the two recordings.

    Attributes:
        cameras: Number of cameras.
        frames: Number of frames.
        views: Number of cameras that take each frame.
        size: Height of the pictures.
        fps: Frames per second.
        near: How many of the cameras of a whole person show the upper body alone.
    """

    cameras: int
    frames: int
    views: int
    size: int
    fps: float
    near: int = 0

    def words(self) -> tuple[object, ...]:
        """The options of ico3d capture synthetic."""
        size = ("--frames", self.frames, "--size", self.size, "--fps", self.fps)
        near = ("--near-cameras", self.near)
        return ("--cameras", self.cameras, "--views-per-frame", self.views, *near, *size)


HEAD = Shot(cameras=24, frames=1580, views=1, size=768, fps=12.5)
"""Two minutes of talk, each frame from another side; every second frame of a film would repeat."""
BODY = Shot(cameras=24, frames=80, views=24, size=1200, fps=2.4, near=14)
"""33 s: all gestures, then all that hands, head and feet do; near cameras see what a page shows."""
TRAIN_HEAD = (
    "--steps 9000 --initial.gaussians 16000 --density.max-gaussians 28000 --density.until 5500 "
    "--density.gradient 0.00018 --density.min-contribution 0.15 --displacements 8 --smile"
)
TRAIN_BODY = (
    "--steps-per-frame 100 --initial.gaussians 64000 --initial.opacity 0.8 "
    "--density.max-gaussians 84000 --density.until 0.6 --density.min-opacity 0.05 "
    "--rates.position 0.0003 --rates.pose 0.0002 --rates.root 0.0002 --rates.joints 0.00005 "
    "--loss.squares 2 --joining.no-match-colors"
)
"""Where skeleton and surface are right, Gaussians stay on it, opaque; at the standard rates half of
them sank below it by a centimetre and more."""


@dataclass(frozen=True)
class Demo:
    """How to make it.

    Attributes:
        subject: Subject file (.npz) of ico3d capture synthetic; WORK gets one of the same name with
            the body that is recorded.
        work: Folder for captures, models and pictures.
        licences: Notices that the subject's sources ask for.
        out: The bundle to write.
        head_shot: Recording of the head.
        body_shot: Recording of the whole person.
        head: Options of ico3d train head in one word, as --head="--steps 500".
        body: Options of ico3d assemble in one word.
        seed: Of recording and training.
        threads: Number of threads of each step.
    """

    subject: tyro.conf.Positional[Path]
    work: Path
    licences: tuple[Path, ...]
    out: Path = FILE
    head_shot: Shot = HEAD
    body_shot: Shot = BODY
    head: str = TRAIN_HEAD
    body: str = TRAIN_BODY
    seed: int = 0
    threads: int = os.cpu_count() or 1

    def run(self) -> None:
        """Records, trains, assembles, bakes, checks."""
        work, seed = self.work, ("--seed", self.seed)
        for name in THREADS:
            os.environ[name] = str(self.threads)
        person = work / self.subject.name
        if not person.exists():
            arrays: dict[str, Any] = slenderer(dict(np.load(self.subject)), SLENDER)
            write_atomic(person, lambda path: np.savez_compressed(path, **arrays))
        # moods and glances are nothing that a voice could drive, except for a smile, which is told
        self._record(person, work / "head-capture", "head", self.head_shot, "--manner", "beaming")
        body = (work / "body-capture", "body", self.body_shot)
        self._record(person, *body, "--motion", "conversation", "--manner", "friendly")
        self._train_head(work / "head-capture", work / "head")
        if not track_file(work / "body-capture").exists():
            write_body_track(true_track(work / "body-capture", person), work / "body-capture")
        parts = (work / "head", work / "body-capture", work / "avatar")
        how = ("--method", "skinned", *self.body.split(), "--check", work / "check")
        ico3d("assemble", *parts, *seed, *how)
        # 2.4 frames a second, with the head turned elsewhere, are poses to learn, no gestures.
        no_clips = to_toml((), self.body_shot.fps, self.body_shot.frames)
        (work / "avatar" / CUTS).write_text(no_clips)
        files = (work / "avatar", work / "head-capture", work / "body-capture", self.out)
        notices = ("--licences", *self.licences, "--made-by", MAKER)
        ico3d("bake", *files, "--strip", work / "strip.png", *notices)
        write_finished(self.out)
        ico3d("render", self.out, work / "gestures.mp4", "--gestures", *GESTURES)
        check(self.out)

    def _record(self, subject: Path, capture: Path, rig: str, shot: Shot, *more: object) -> None:
        if (capture / "capture.json").exists():
            return
        pictures = shot.frames * shot.views
        left = pictures - sum(1 for _ in (capture / "masks").glob("*/*.png"))
        each = _seconds_of_a_picture(subject, rig, shot)
        print(
            f"{capture.name}: {left} of {pictures} pictures are left, {each:.2f} s of processor "
            f"time each: {left * each / 3600:.1f} h.",
            flush=True,
        )
        who = ("--subject", subject, "--seed", self.seed, "--rig", rig)
        who = (*who, "--no-lively", "--light", LIGHT)
        ico3d("capture synthetic", capture, *who, *shot.words(), *more, "--workers", self.threads)

    def _train_head(self, capture: Path, head: Path) -> None:
        options = ("--inputs", "speech", "--seed", self.seed, *self.head.split())
        if not head.exists():
            ico3d("train head", capture, head, *options, "--dry-run")  # says how long it takes
        ico3d("train head", capture, head, *options)
        if not (head / "metrics.json").exists():
            ico3d("evaluate", head, capture, "--json", head / "metrics.json")


def slenderer(person: dict[str, np.ndarray], share: float) -> dict[str, np.ndarray]:
    """The arrays of a subject file with a more slender body; head, hands and shoes stay.

    Args:
        person: The arrays.
        share: How far to go to MakeHuman's slender build; 1 is all the way.
    """
    names, parents = person["joint_names"], person["joint_parents"]
    places = person["joint_pos"].astype(np.float64)
    rig = Rig(tuple(map(str, names)), tuple(map(int, parents)), places)
    moves, _ = change_to("slender", rig).at(person["verts"].astype(np.float64))
    return person | {"verts": (person["verts"] + share * moves).astype(np.float32)}


def _seconds_of_a_picture(subject: Path, rig: str, shot: Shot) -> float:
    """Processor time of a picture and its share of what a frame takes, from a few pictures."""
    person = load_subject(str(subject), rig == "body")
    studio = Studio(person, STUDIOS[LIGHT], "plain")
    cameras = cameras_of(person, rig, shot.cameras, shot.size, shot.near)[-TRIED:]
    pose = np.eye(4)
    pose[:3, 3] = person.head_in_world
    vertices = person.vertices.astype(np.float32)
    for camera in cameras:  # the first pictures compile
        studio.picture(camera, studio.figure(vertices, pose))
    begun = time.process_time()
    figure = studio.figure(vertices, pose)
    prepared = time.process_time()
    for camera in cameras:
        studio.picture(camera, figure)
    drawn = time.process_time()
    return (drawn - prepared) / TRIED + (prepared - begun) / shot.views


def check(path: Path) -> None:
    """Prints what a bundle holds; ends this program where it is too large."""
    bundle = Bundle.open(path)
    manifest, size = bundle.manifest, path.stat().st_size
    late = sum(manifest.files[n].size for n in (HEAD_REST, SKINNED_REST) if n in manifest.files)
    print(manifest.loss, f"{size / 1e6:.2f} MB, {(size - late) / 1e6:.2f} MB of them first")
    if size > MAX_BYTES or size - late > MAX_FIRST_BYTES:
        sys.exit(f"{path} has more bytes, in all or at first, than a package should carry.")


def ico3d(verb: str, *words: object) -> None:
    """Runs one verb; ends this program where it fails."""
    command = [sys.executable, "-m", "ico3d.cli", *verb.split(), *map(str, words)]
    print("+ ico3d", *command[3:], flush=True)
    if subprocess.run(command).returncode:
        sys.exit(f"ico3d {verb} failed.")


if __name__ == "__main__":
    sys.exit(run_script(Demo))
