"""Trains with the paper's settings, at a stretch and killed in between, and compares the two."""

import json
import os
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

import torch
from safetensors.torch import load_file

from ico3d.cli import main
from ico3d.errors import ModelError
from ico3d.training.processes import fork_server
from ico3d.training.run import CHECKPOINT

PATIENCE = 600.0
"""Seconds within which a training must have written a checkpoint."""
FEW = ("--initial.gaussians", "500", "--density.max-gaussians", "1000")


@dataclass(frozen=True)
class Interrupted:
    """A training at a stretch, and the same one after SIGKILL.

    Attributes:
        cpu_seconds: Processor seconds at a stretch, without imports.
        peak_mib: Largest memory of the GPU at a stretch, MiB; 0 without one.
        train_seconds: Seconds of its steps.
        num_gaussians: Gaussians at a stretch.
        tensors: Number of tensors in its models.
        alike: Number of those that are the same, bit for bit, after the interruption.
        greatest: Greatest difference relative to the largest value of a tensor; None if numbers of
            Gaussians differ.
    """

    cpu_seconds: float
    peak_mib: float
    train_seconds: float
    num_gaussians: int
    tensors: int
    alike: int
    greatest: float | None


def paper_options(verb: str, steps: int, device: str) -> list[str]:
    """Options of `ico3d train` with all that the paper's settings switch on, in few steps.

    Args:
        verb: head, body or static.
        steps: Optimisation steps; of bodies, of each window and of fine-tuning each.
        device: Where to compute.
    """
    third, tenth = str(max(steps // 3, 1)), str(max(steps // 10, 1))
    options = ["--preset", "paper", "--device", device, "--steps", str(steps)]
    options += ["--checkpoint-every", third, "--sh-degree", "3", "--sh-every", tenth]
    options += ["--density.begin", tenth, "--density.every", str(max(steps // 15, 1))]
    if verb == "head":
        return [*options, "--optimiser", "sgd", "--loss.perceptual-from", "0", *FEW]
    if verb == "static":
        return [*options, "--only", "person", "--frames", "0", "--initial.gaussians", "500"]
    cut = ["--windows.longest", "6", "--windows.shortest", "3"]
    tuned = ["--warmup-steps", tenth, "--finetune.steps", third]
    return [*options, "--color-correction", *cut, *tuned, *FEW]


def train_twice(
    verb: str, capture: Path, out: Path, options: list[str], models: str | None = None
) -> Interrupted:
    """Trains at a stretch, and with an interruption by SIGKILL at the first checkpoint.

    Args:
        verb: head, body or static.
        capture: The recording.
        out: Folder for the trainings.
        options: Further words of the verb.
        models: Folder of weights, as of the environment variable ICO3D_MODELS.

    Raises:
        ModelError: If a training fails, or ends before it could be killed.
    """
    told = {} if models is None else {"ICO3D_MODELS": models}

    def words(name: str) -> list[str]:
        return ["train", verb, str(capture), str(out / f"{verb}-{name}"), *options]

    # Kernels compiled at different times may round differently: both runs load one set.
    run_verb(words("first"), told)
    seconds, peak = run_verb(words("whole"), told)
    _kill(words("parts"), told, out / f"{verb}-parts")
    run_verb(words("parts"), told)
    whole = out / f"{verb}-whole"
    finished = json.loads((whole / "finished.json").read_text())
    compared = _compared(whole, out / f"{verb}-parts")
    return Interrupted(
        seconds, peak, finished["train_seconds"], finished["num_gaussians"], *compared
    )


def run_verb(words: list[str], environment: Mapping[str, str]) -> tuple[float, float]:
    """Runs a verb in a process of its own.

    Returns:
        Its processor seconds without imports, and the largest memory of the GPU in MiB.

    Raises:
        ModelError: If it fails.
    """
    process, received = _started(words, environment)
    try:
        used = received.recv()
    except EOFError:
        used = None
    process.join()
    if process.exitcode or used is None:
        raise ModelError(f"ico3d {' '.join(words[:3])} ended with status {process.exitcode}.")
    return used


def _started(words: list[str], environment: Mapping[str, str]) -> tuple[BaseProcess, Connection]:
    """A process that runs a verb, and where it sends its seconds."""
    context = fork_server("ico3d.body.training.train_clip")
    received, sender = context.Pipe(duplex=False)
    process = context.Process(target=_verb, args=(words, dict(environment), sender), daemon=True)
    process.start()
    sender.close()
    return process, received


def _verb(words: list[str], environment: dict[str, str], sender: Connection) -> None:
    """What the process does."""
    os.environ.update(environment)
    status = main(words)
    peak = torch.cuda.max_memory_allocated() if torch.cuda.is_initialized() else 0
    sender.send((time.process_time(), peak / 2**20))
    sys.exit(status)


def _kill(words: list[str], environment: Mapping[str, str], folder: Path) -> None:
    """Starts a verb and kills it as soon as a run in its folder has a checkpoint.

    Raises:
        ModelError: If the verb ends before.
    """
    process, _ = _started(words, environment)
    until = time.monotonic() + PATIENCE
    while not any(folder.rglob(CHECKPOINT)):
        if not process.is_alive() or time.monotonic() > until:
            process.kill()
            raise ModelError(f"{folder} had no checkpoint to be killed at.")
        time.sleep(0.005)
    process.kill()
    process.join()


def _compared(whole: Path, parts: Path) -> tuple[int, int, float | None]:
    """Number of tensors in all models of two folders, of equal ones, and the largest difference.

    Raises:
        ModelError: If files or names of tensors differ.
    """
    count, alike, greatest = 0, 0, 0.0
    for path in sorted(whole.rglob("*.safetensors")):
        theirs, ours = load_file(path), load_file(parts / path.relative_to(whole))
        if ours.keys() != theirs.keys():
            raise ModelError(f"{path.name} has other tensors after the run was killed.")
        for name, value in theirs.items():
            count += 1
            alike += torch.equal(ours[name], value)
            if ours[name].shape != value.shape:
                greatest = float("inf")
            elif value.is_floating_point() and value.numel():
                apart = (ours[name] - value).abs().max() / value.abs().max().clamp_min(1e-30)
                greatest = max(greatest, float(apart))
    return count, alike, greatest if greatest < float("inf") else None
