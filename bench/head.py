"""The head against its ablations: variants × seeds on one capture, at equal Gaussians and time.

    ico3d capture synthetic CAPTURE --subject human_face_f.npz --rig head --cameras 6 \
        --frames 1100 --views-per-frame 1 --size 256 --seed 0
    python bench/head.py CAPTURE OUT                 # blendshapes: 3 variants × 3 seeds
    python bench/head.py CAPTURE OUT --inputs speech --variants full --seeds 0 --against OTHER

OTHER is a capture of the same subject with other words and another voice; its frames were never
trained on. Every finished training and measurement is kept in OUT and not repeated, an interrupted
one goes on. Each line of the table is a mean over seeds; OUT/table.json holds the same.
Lips are measured where MediaPipe and `face_landmarker.task` (in $ICO3D_MODELS) are there.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import tyro

from ico3d.cli import run_script
from ico3d.head.settings import PRESETS

STEP_FACTOR = {"full": 1.0, "no-mlp": 1.6, "no-blending": 1.0, "static": 1.6}
"""Steps relative to those of `full`, such that all train for the same time: at 12,000 Gaussians
and 256² a step takes 58 ms of one core with the MLP and 37 ms without."""

KEYS = ("psnr", "psnr_mask", "psnr_mouth", "ssim", "lmd", "lip_correlation", "lip_lag_ms")
COSTS = ("num_gaussians", "ms_per_frame", "train_seconds")


@dataclass(frozen=True)
class Bench:
    """What to compare.

    Attributes:
        capture: Capture to train on and, unless `against` is given, to measure on.
        out: Folder for models, metrics and the table.
        variants: Models to compare.
        seeds: Each variant is trained once per seed.
        inputs: What drives the heads.
        against: Another capture to measure on, all of its frames.
        steps: Steps of the full model; those of the preset by default.
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    variants: tuple[str, ...] = ("full", "static", "no-blending")
    seeds: tuple[int, ...] = (0, 1, 2)
    inputs: Literal["speech", "blendshapes"] = "blendshapes"
    against: Path | None = None
    steps: int = PRESETS["cpu"].steps

    def run(self) -> None:
        """Trains and measures what is missing, prints the table."""
        scores = {v: [self._scores(v, seed) for seed in self.seeds] for v in self.variants}
        table = {variant: _means(rows) for variant, rows in scores.items()}
        (self.out / "table.json").write_text(json.dumps(table, indent=1))
        print_table(table)

    def _scores(self, variant: str, seed: int) -> dict:
        """The metrics of one training, from its file or made now."""
        model = self.out / f"{self.inputs}-{variant}-{seed}"
        steps = round(self.steps * STEP_FACTOR[variant])
        _ico3d("train", "head", self.capture, model, "--inputs", self.inputs, "--variant", variant,
               "--seed", seed, "--preset", "cpu", "--steps", steps)  # fmt: skip
        measured = self.against or self.capture
        file = model / f"metrics-{measured.name}.json"
        if not file.exists():
            frames = "all" if self.against else "test"
            _ico3d("evaluate", model, measured, "--frames", frames, "--json", file,
                   "--images", model / f"images-{measured.name}")  # fmt: skip
        return json.loads(file.read_text())


def _ico3d(*words: object) -> None:
    """Runs one command as a user would; ends this program where it fails."""
    if subprocess.run([sys.executable, "-m", "ico3d.cli", *map(str, words)]).returncode:
        sys.exit(f"ico3d {' '.join(map(str, words[:2]))} failed.")


def _means(rows: list[dict]) -> dict[str, float | None]:
    """Mean over seeds of each metric, None where one of them lacks it."""
    return {
        key: float(np.mean([row[key] for row in rows]))
        if all(row[key] is not None for row in rows)
        else None
        for key in KEYS + COSTS
    }


def print_table(table: dict[str, dict[str, float | None]]) -> None:
    """One line per variant."""
    print(f"{'':12}" + "".join(f"{key:>16}" for key in KEYS + COSTS))
    for variant, means in table.items():
        cells = (means[key] for key in KEYS + COSTS)
        print(f"{variant:12}" + "".join(f"{'–' if c is None else f'{c:.3f}':>16}" for c in cells))


if __name__ == "__main__":
    sys.exit(run_script(Bench))
