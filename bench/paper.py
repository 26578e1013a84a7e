"""The paper's settings with all that they switch on: killed, gone on with, and compared.

    python bench/paper.py OUT [--steps 300] [--size 32] [--json F]

Records a synthetic person and trains head, body and scene on it by the command line, with
--preset paper, SGD and VGG from the first step for the head, harmonics of degree 3, colour maps for
the body's cameras, and a density control that is squeezed into so few steps. Each is trained
twice (and once before, which compiles kernels): once at a stretch, once killed by SIGKILL as soon
as it has a checkpoint, and then gone on with. Both must hold the same tensors, bit for bit. VGG's
weights are those that are installed; without, random ones of its shape are written to OUT.
"""

import json
import os
import resource
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import torch
import tyro
from rich.console import Console
from safetensors.torch import load_file, save_file

from ico3d.cli import run_script
from ico3d.common.weights import find_model
from ico3d.errors import ModelError
from ico3d.head.perceptual import CHANNELS, WEIGHTS, vgg_layers
from ico3d.training.run import CHECKPOINT

PATIENCE = 600.0
"""Seconds within which a training must have written a checkpoint."""


@dataclass(frozen=True)
class Paper:
    """The bench.

    Attributes:
        out: Where recordings and models lie; must be empty.
        steps: Optimisation steps; of bodies, of each window and of fine-tuning each.
        size: Side of the head's pictures, in pixels; VGG looks at each of them.
        subject: Who is recorded: anny, or an NPZ file.
        device: Where to compute.
        json: Also write figures here.
    """

    out: tyro.conf.Positional[Path]
    steps: int = 300
    size: int = 32
    subject: str = "anny"
    device: Annotated[str, tyro.conf.arg(metavar="auto|cpu|cuda")] = "cpu"
    json: Path | None = None

    def run(self) -> None:
        """Trains, compares, prints and writes the figures.

        Raises:
            ModelError: If a model that was killed and gone on with differs from the other.
        """
        self.out.mkdir(parents=True, exist_ok=True)
        if find_model(WEIGHTS) is None:
            _write_random_vgg(self.out)
            os.environ["ICO3D_MODELS"] = str(self.out)
        head, body = self.out / "head-capture", self.out / "body-capture"
        record = ["capture", "synthetic", "--subject", self.subject]
        _run(*record, str(head), "--cameras", "2", "--frames", "22", "--size", str(self.size))
        _run(*record, str(body), "--rig", "body", "--cameras", "6", "--frames", "9", "--size", "64")
        found = {
            "head": self._twice("head", head, *self._head),
            "body": self._twice("body", body, *self._body),
            "scene": self._twice("static", body, *self._scene),
        }
        for name, figures in found.items():
            Console().print(f"{name}: {figures}")
        if self.json:
            self.json.write_text(json.dumps(found, indent=1))

    @property
    def _grown(self) -> list[str]:
        """Options by which Gaussians grow within few steps."""
        begin, every = max(self.steps // 10, 1), max(self.steps // 15, 1)
        return ["--density.begin", str(begin), "--density.every", str(every)]

    @property
    def _often(self) -> list[str]:
        """Options of all trainings: steps, how often they save, how fast harmonics come."""
        third, tenth = str(max(self.steps // 3, 1)), str(max(self.steps // 10, 1))
        options = ["--steps", str(self.steps), "--checkpoint-every", third, "--sh-degree", "3"]
        return [*options, "--sh-every", tenth, "--device", self.device, *self._grown]

    @property
    def _head(self) -> list[str]:
        count = ["--initial.gaussians", "500", "--density.max-gaussians", "1000"]
        return ["--optimiser", "sgd", "--loss.perceptual-from", "0", *count]

    @property
    def _body(self) -> list[str]:
        count = ["--initial.gaussians", "500", "--density.max-gaussians", "1000"]
        warm = ["--warmup-steps", str(self.steps // 10), "--finetune.steps", str(self.steps // 3)]
        cut = ["--windows.longest", "6", "--windows.shortest", "3"]
        return ["--color-correction", *cut, *warm, *count]

    @property
    def _scene(self) -> list[str]:
        return ["--only", "person", "--frames", "0", "--initial.gaussians", "500"]

    def _twice(self, verb: str, capture: Path, *options: str) -> dict:
        """Trains at a stretch and with an interruption; CPU seconds, Gaussians and tensors."""
        words = ["train", verb, str(capture)]
        told = ["--preset", "paper", *self._often, *options]
        whole, parts = self.out / f"{verb}-whole", self.out / f"{verb}-parts"
        # Kernels compiled at different times may round differently: both runs load one set.
        _run(*words, str(self.out / f"{verb}-first"), *told)
        seconds = _run(*words, str(whole), *told)
        _killed([*words, str(parts), *told], parts)
        _run(*words, str(parts), *told)
        compared = _compared(whole, parts)
        finished = json.loads((whole / "finished.json").read_text())
        return {"cpu_seconds": round(seconds, 1), "tensors_alike": compared, **finished}


def _run(*words: str) -> float:
    """Runs a verb; CPU seconds of it and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "ico3d.cli", *words], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _killed(words: list[str], folder: Path) -> None:
    """Starts a verb and kills it as soon as a run in its folder has a checkpoint.

    Raises:
        ModelError: If the verb ends before.
    """
    process = subprocess.Popen([sys.executable, "-m", "ico3d.cli", *words])
    until = time.monotonic() + PATIENCE
    while not any(folder.rglob(CHECKPOINT)):
        if process.poll() is not None or time.monotonic() > until:
            process.kill()
            raise ModelError(f"{folder} had no checkpoint to be killed at.")
        time.sleep(0.005)
    process.kill()
    process.wait()


def _compared(whole: Path, parts: Path) -> int:
    """Number of tensors in all models of two folders, which must be the same.

    Raises:
        ModelError: If a file or a tensor differs.
    """
    files = sorted(path.relative_to(whole) for path in whole.rglob("*.safetensors"))
    count = 0
    for file in files:
        ours, theirs = load_file(parts / file), load_file(whole / file)
        same = ours.keys() == theirs.keys()
        if not same or not all(torch.equal(ours[name], theirs[name]) for name in theirs):
            raise ModelError(f"{file} differs after the run was killed and gone on with.")
        count += len(theirs)
    return count


def _write_random_vgg(folder: Path) -> None:
    """Random weights of VGG-16 up to relu3_3, under the names of the public file."""
    torch.manual_seed(0)
    layers = vgg_layers(CHANNELS).state_dict()
    save_file({f"features.{name}": value for name, value in layers.items()}, folder / WEIGHTS)


if __name__ == "__main__":
    sys.exit(run_script(Paper))
