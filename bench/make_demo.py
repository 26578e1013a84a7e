"""Builds the demo avatar that comes in the package, from a subject file to the bundle.

    python bench/make_demo.py human_face_f.npz --licences ICT-FaceKit-LICENSE.txt --work WORK

Head and body are recorded in two studios whose light differs. Steps of the command line, each
skipped when WORK holds its result already; the seed decides everything. Look at WORK/check,
WORK/strip.png (recorded | exact | baked) and WORK/gestures.mp4 before shipping it. The skeleton
needs MediaPipe's pose and hand landmarkers: ico3d weights fetch pose-landmarker hand-landmarker.
"""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro

from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import FILE
from ico3d.cli import run_script

MAX_BYTES = 12 << 20
GESTURES = ("wave", "point", "open_hands", "shrug", "count_three", "nod", "shake", "think")
"""To look at: hands, armpits and neck in poses that nobody recorded."""


@dataclass(frozen=True)
class Demo:
    """How to make it.

    Attributes:
        subject: Subject file (.npz) of ico3d capture synthetic.
        work: Folder for captures, models and pictures.
        licences: Notices that the subject's sources ask for.
        out: The bundle to write.
        head_frames: Frames of the head at 25 per second.
        body_frames: Frames of the body at 8 per second: in 9 s both arms leave the body, and what
            never did cannot be told from it.
        size: Height of the pictures.
        body: More options of ico3d assemble in one word, as --body="--steps 5000".
        seed: Of recording and training.
    """

    subject: tyro.conf.Positional[Path]
    work: Path
    licences: tuple[Path, ...]
    out: Path = FILE
    head_frames: int = 1600
    body_frames: int = 76
    size: int = 384
    body: str = "--density.max-gaussians 20000 --initial.gaussians 12000 --steps-per-frame 150"
    seed: int = 0

    def run(self) -> None:
        """Records, trains, assembles, bakes, checks."""
        work, seed = self.work, ("--seed", self.seed)
        # moods and glances are nothing that a voice could drive
        face = ("--rig", "bust", "--light", "studio", "--no-lively", "--cameras", 6)
        self._record(work / "head-capture", self.head_frames, *face)
        rings = ("--rig", "body", "--light", "warm", "--motion", "talk", "--cameras", 20)
        self._record(work / "body-capture", self.body_frames, *rings, "--fps", 8)
        ico3d("train head", work / "head-capture", work / "head", "--inputs", "speech", *seed)
        if not (work / "body-capture" / "body_track.safetensors").exists():
            ico3d("capture pose", work / "body-capture")
        parts = (work / "head", work / "body-capture", work / "avatar")
        how = ("--method", "skinned", *self.body.split(), "--check", work / "check")
        ico3d("assemble", *parts, *seed, *how)
        files = (work / "avatar", work / "head-capture", work / "body-capture", self.out)
        notices = ("--licences", *self.licences)
        ico3d("bake", *files, "--strip", work / "strip.png", *notices)
        ico3d("render", self.out, work / "gestures.mp4", "--gestures", *GESTURES)
        size = self.out.stat().st_size
        if size > MAX_BYTES:
            sys.exit(f"{self.out} has {size / 1e6:.1f} MB, more than a package should carry.")
        print(Bundle.open(self.out).manifest.loss, f"{size / 1e6:.2f} MB")

    def _record(self, capture: Path, frames: int, *shot: object) -> None:
        if (capture / "capture.json").exists():
            return
        size = ("--frames", frames, "--size", self.size, "--seed", self.seed)
        ico3d("capture synthetic", capture, "--subject", self.subject, *size, *shot)


def ico3d(verb: str, *words: object) -> None:
    """Runs one verb; ends this program where it fails."""
    command = [sys.executable, "-m", "ico3d.cli", *verb.split(), *map(str, words)]
    print("+ ico3d", *command[3:], flush=True)
    if subprocess.run(command).returncode:
        sys.exit(f"ico3d {verb} failed.")


if __name__ == "__main__":
    sys.exit(run_script(Demo))
