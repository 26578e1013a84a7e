"""A head from a recording that knows as little of the person as RenderMe-360 does.

    python bench/renderme_head.py human_face_f.npz --work WORK --json head.json

Six cameras before a person who talks, points on the head alone, no landmarks, no eye values, masks
of the whole person, a cloth in the pictures and no clean plate of it. Making the recording does not
count; then the README's commands train, measure and bake the head. Steps that are done are not
repeated.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro
from smc_line import timed

from ico3d.bundle.format import Bundle
from ico3d.capture.formats import open_capture
from ico3d.cli import run_script
from ico3d.studio.layouts.smc import write_renderme_fits

FPS = 30
LEAST = 30.0
"""dB of PSNR on the person's pixels of held-out frames."""


@dataclass(frozen=True)
class RenderMeHead:
    """How large a recording goes in.

    Attributes:
        subject: Subject file (.npz) of ico3d capture synthetic.
        work: Folder for everything.
        frames: How many; the last eleventh tests.
        cameras: How many.
        views: Cameras that take each frame.
        size: Height of the pictures.
        options: More options of ico3d train head in one word, as --options="--steps 5000".
        seeds: A training for each.
        json: Where to write the figures.
    """

    subject: tyro.conf.Positional[Path]
    work: Path
    frames: int = 600
    cameras: int = 6
    views: int = 6
    size: int = 256
    options: str = ""
    seeds: tuple[int, ...] = (0,)
    json: Path | None = None

    def run(self) -> None:
        """Records, trains, measures, bakes; prints and writes the figures."""
        recording, found = self._recorded(), []
        for seed in self.seeds:
            head = self.work / f"head-{seed}"
            bundle, metrics = head / "head.ico3d", head / "metrics.json"
            timed("train head", recording, head, "--seed", seed, *self.options.split())
            timed("evaluate", head, recording, "--json", metrics, "--images", head / "images")
            strip = ("--strip", head / "strip.png")
            timed("bake", head, recording, bundle, *strip, "--made-by", "ico3d", "--force")
            loss = Bundle.open(bundle).manifest.loss
            found.append(json.loads(metrics.read_text()) | {"loss": vars(loss) if loss else None})
        print(json.dumps(found, indent=1))
        if self.json:
            self.json.write_text(json.dumps(found, indent=1) + "\n")
        worst = min(figures["psnr_mask"] for figures in found)
        if worst < LEAST:
            sys.exit(f"{worst:.1f} dB on the person, less than {LEAST:g}.")

    def _recorded(self) -> Path:
        """A folder in the layout of RenderMe-360."""
        studio, files = self.work / "studio", self.work / "renderme"
        if not (studio / "capture.json").exists():
            row = ("--rig", "bust", "--cameras", self.cameras, "--frames", self.frames)
            more = ("--views-per-frame", self.views, "--size", self.size, "--fps", FPS)
            who = ("--subject", self.subject, "--no-lively")
            timed("capture synthetic", studio, *who, *row, *more)
        if not files.exists():
            write_renderme_fits(open_capture(studio), files, "0001_e0")
        return files


if __name__ == "__main__":
    sys.exit(run_script(RenderMeHead))
