"""What one step of head training costs, and what it is spent on.

    python bench/step.py CAPTURE --json step.json

Blendshapes, the CPU preset, as many Gaussians as `--gaussians`, from the first step on; with
`--close-ups 4` the four crops of the mouth that the preset has, too. Run it with
PYTHONPATH at another version of the sources to compare. Parts are self times of the named kernels;
what is left is the basis' optimiser, which torch does not see, and small operations.
"""

import json
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import tyro
from torch.profiler import ProfilerActivity, profile

from ico3d.capture.formats import open_capture
from ico3d.cli import run_script
from ico3d.head.expressions import BlendshapeTrack
from ico3d.head.initial_gaussians import initial_head
from ico3d.head.optimise import HeadTrainer
from ico3d.head.settings import PRESETS, Initial

PARTS = {
    "projection": ("Project",),
    "drawing": ("Draw",),
    "projection backward": ("ProjectBackward",),
    "drawing backward": ("DrawBackward",),
    "loss": ("_CpuPhotometric",),
    "blending": ("_Blend",),
    "MLP": ("aten::mm", "aten::addmm"),
}


@dataclass(frozen=True)
class Bench:
    """What to time.

    Attributes:
        capture: Capture with blendshapes.
        gaussians: Gaussians of the head.
        close_ups: Crops of the mouth in each step.
        steps: Steps that are timed.
        json: Where to write the figures.
    """

    capture: tyro.conf.Positional[Path]
    gaussians: int = 12_000
    close_ups: int = 0
    steps: int = 100
    json: Path | None = None

    def run(self) -> None:
        """Prints, and writes, the median step and its parts in milliseconds."""
        trainer = self._trainer()
        for index in range(10):
            trainer.step(index)
        seconds = []
        for index in range(10, 10 + self.steps):
            start = time.perf_counter()
            trainer.step(index)
            seconds.append(time.perf_counter() - start)
        figures = {"step": 1e3 * float(np.median(seconds)), **self._parts(trainer)}
        for name, value in figures.items():
            print(f"{name:20} {value:6.2f} ms")
        if self.json is not None:
            self.json.write_text(json.dumps(figures, indent=1))

    def _trainer(self) -> HeadTrainer:
        capture = open_capture(self.capture)
        settings = PRESETS["cpu"]
        density = replace(settings.density, max_gaussians=self.gaussians)
        initial = Initial(self.gaussians)
        settings = replace(settings, initial=initial, density=density, close_ups=self.close_ups)
        track = BlendshapeTrack(capture, capture.blendshape_names or ())
        torch.manual_seed(0)
        model = initial_head(capture, settings, "full", track.size, np.random.default_rng(0))
        return HeadTrainer(capture, model, track, None, settings, 0)

    def _parts(self, trainer: HeadTrainer) -> dict[str, float]:
        count = 20
        with profile(activities=[ProfilerActivity.CPU]) as recorded:
            for index in range(count):
                trainer.step(10 + self.steps + index)
        own = {event.key: event.self_cpu_time_total for event in recorded.key_averages()}
        return {
            part: sum(own.get(name, 0.0) for name in names) / count / 1e3
            for part, names in PARTS.items()
        }


if __name__ == "__main__":
    sys.exit(run_script(Bench))
