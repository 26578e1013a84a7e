"""The whole line of docs/guides/dna-renderme.md, timed: from SMC files to a bundle, on one machine.

    python bench/smc_line.py human_face_f.npz --work WORK --json line.json

A synthetic person is recorded in two studios, head and shoulders in neutral light, the whole body
in warm light, and written in the layouts of RenderMe-360 and DNA-Rendering. Making those files does
not count; everything from there on does, one command per step. Times are wall-clock: run it on a
quiet machine. Steps of an interrupted run go on, and their times then mean nothing.
"""

import json
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import tyro

from ico3d.bundle.format import Bundle
from ico3d.capture.formats import open_capture
from ico3d.cli import run_script
from ico3d.studio.layouts.smc import write_dna, write_renderme

FPS = 15
LIMIT = 40.0
"""Minutes that the line may take on two cores at these sizes."""


@dataclass(frozen=True)
class Line:
    """How large a recording goes in.

    Attributes:
        subject: Subject file (.npz) of ico3d capture synthetic, with a body.
        work: Folder for everything.
        head_frames: Frames of the head.
        head_cameras: Cameras of the head, which all take every frame.
        body_frames: Frames of the body.
        body_cameras: Cameras of the body.
        head_size: Height of the head's pictures.
        body_size: Height of the body's pictures.
        head: More options of ico3d train head in one word, as --head="--steps 2500".
        body: More options of ico3d assemble in one word.
        seed: Of recording and training.
        json: Where to write the times.
    """

    subject: tyro.conf.Positional[Path]
    work: Path
    head_frames: int = 240
    head_cameras: int = 5
    body_frames: int = 31
    body_cameras: int = 16
    head_size: int = 224
    body_size: int = 448
    head: str = "--steps 2500"
    body: str = "--steps-per-frame 100 --finetune.steps 800"
    seed: int = 0
    json: Path | None = None

    def run(self) -> None:
        """Records, converts, follows the guide, prints and writes the times."""
        work = self.work
        files = self._recorded()
        face, body, head, person = (
            work / name for name in ("captures/face", "captures/body", "head", "person")
        )
        bundle, seed = work / "person.ico3d", ("--seed", self.seed)
        strip = ("--strip", work / "strip.png")
        steps: tuple[tuple[str, tuple[object, ...]], ...] = (
            ("capture check", (files[0],)),
            ("capture check", (files[1],)),
            ("capture resize", (files[0], face, "--height", self.head_size)),
            ("capture resize", (files[1], body, "--height", self.body_size)),
            ("capture track", (face, "--check", work / "face.jpg")),
            ("capture track", (body, "--check", work / "body.jpg")),
            ("train head", (face, head, *seed, *self.head.split())),
            (
                "assemble",
                (head, body, person, *seed, "--check", work / "check", *self.body.split()),
            ),
            ("evaluate", (person, body, "--images", work / "pictures")),
            ("bake", (person, face, body, bundle, *strip, "--made-by", "ico3d", "--force")),
        )
        times = [(verb, round(timed(verb, *words), 1)) for verb, words in steps]
        total = sum(seconds for _, seconds in times)
        loss = Bundle.open(bundle).manifest.loss
        about = {"steps": times, "minutes": round(total / 60, 2), "bytes": bundle.stat().st_size}
        print(json.dumps(about | {"loss": vars(loss) if loss else None}, indent=1))
        if self.json:
            self.json.write_text(json.dumps(about, indent=1) + "\n")
        if total > 60 * LIMIT:
            sys.exit(f"the line took {total / 60:.1f} minutes, more than {LIMIT:g}.")

    def _recorded(self) -> tuple[Path, Path]:
        """Folders in the layouts of RenderMe-360 and DNA-Rendering."""
        files = self.work / "renderme", self.work / "dna"
        shots = (
            ("face", self.head_frames, self.head_cameras, self.head_size, ("bust", "studio")),
            ("body", self.body_frames, self.body_cameras, self.body_size, ("body", "warm")),
        )
        names = (write_renderme, "0001_s1_all"), (write_dna, "0001_01")
        for shot, folder, (write, name) in zip(shots, files, names, strict=True):
            what, frames, cameras, size, (rig, light) = shot
            recorded = self.work / f"recorded-{what}"
            if not (recorded / "capture.json").exists():
                row = ("--rig", rig, "--light", light, "--cameras", cameras, "--frames", frames)
                more = ("--views-per-frame", cameras, "--size", size, "--fps", FPS, "--no-lively")
                who = ("--subject", self.subject, "--seed", self.seed)
                timed("capture synthetic", recorded, *who, *row, *more)
            if not folder.exists():
                write(open_capture(recorded), folder, name)
        return files


def timed(verb: str, *words: object) -> float:
    """Seconds that a verb takes; ends this program where it fails."""
    command = [sys.executable, "-m", "ico3d.cli", *verb.split(), *map(str, words)]
    print("+ ico3d", *command[3:], flush=True)
    begin = time.monotonic()
    if subprocess.run(command).returncode:
        sys.exit(f"ico3d {verb} failed.")
    return time.monotonic() - begin


if __name__ == "__main__":
    sys.exit(run_script(Line))
