"""Builds the demo avatar that comes in the package, from a subject file to the bundle.

    python bench/make_demo.py human_face_f.npz --licences ICT-FaceKit-LICENSE.txt --work WORK

Three steps of the command line, each skipped when WORK holds its result already; the seed
decides everything. Look at WORK/strip.png (recorded | exact | baked) before shipping it.
"""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro

from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import FILE

MAX_BYTES = 12 << 20


@dataclass(frozen=True)
class Demo:
    """How to make it.

    Attributes:
        subject: Subject file (.npz) of ico3d capture synthetic.
        work: Folder for capture, model and strip.
        licences: Notices that the subject's sources ask for.
        out: The bundle to write.
        frames: Frames at 25 per second to record.
        size: Width and height of the pictures.
        steps: Steps of training; those of the preset by default.
        gaussians: Gaussians of the head; those of the preset by default.
        seed: Of recording and training.
    """

    subject: tyro.conf.Positional[Path]
    work: Path
    licences: tuple[Path, ...]
    out: Path = FILE
    frames: int = 1600
    size: int = 384
    steps: int | None = None
    gaussians: int | None = None
    seed: int = 0

    def run(self) -> None:
        """Records, trains, bakes, checks."""
        capture, model = self.work / "capture", self.work / "model"
        if not capture.exists():
            self._record(capture)
        changes = self._changes()
        ico3d("train head", capture, model, "--inputs", "speech", "--seed", self.seed, *changes)
        notices = ("--licences", *self.licences)
        ico3d("bake", model, capture, self.out, "--strip", self.work / "strip.png", *notices)
        size = self.out.stat().st_size
        if size > MAX_BYTES:
            sys.exit(f"{self.out} has {size / 1e6:.1f} MB, more than a package should carry.")
        print(Bundle.open(self.out).manifest.loss, f"{size / 1e6:.2f} MB")

    def _record(self, capture: Path) -> None:
        # moods and glances are nothing that a voice could drive
        shot = ("--rig", "bust", "--no-lively", "--cameras", 6)
        size = ("--frames", self.frames, "--size", self.size, *shot)
        ico3d("capture synthetic", capture, "--subject", self.subject, *size, "--seed", self.seed)

    def _changes(self) -> list[str]:
        values = {
            "steps": self.steps,
            "initial_gaussians": self.gaussians,
            "max_gaussians": self.gaussians,
        }
        changes = [f"{name}={value}" for name, value in values.items() if value is not None]
        return ["--set", *changes] if changes else []


def ico3d(verb: str, *words: object) -> None:
    """Runs one verb; ends this program where it fails."""
    command = [sys.executable, "-m", "ico3d.cli", *verb.split(), *map(str, words)]
    print("+ ico3d", *command[3:], flush=True)
    if subprocess.run(command).returncode:
        sys.exit(f"ico3d {verb} failed.")


if __name__ == "__main__":
    tyro.cli(Demo).run()
