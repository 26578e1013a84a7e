"""The loop every optimisation runs in: resume, step, log, check, save."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from ico3d.errors import ModelError
from ico3d.training.log import MetricsLog, progress_bar
from ico3d.training.run import RunFolder


class Trainee(Protocol):
    """What the loop optimises.

    All randomness of a step must follow from the seed and the step's number, so that a resumed
    run repeats the uninterrupted one.
    """

    def step(self, index: int) -> Mapping[str, float | Tensor]:
        """Does optimisation step `index`; returns its numbers, `loss` among them."""
        ...

    def tensors(self) -> dict[str, Tensor]:
        """Everything that steps change: parameters and optimiser moments, by name."""
        ...

    def state(self) -> dict:
        """What else steps change, JSON-serialisable."""
        ...

    def restore(self, tensors: dict[str, Tensor], state: dict) -> None:
        """Takes back what `tensors` and `state` gave."""
        ...


@dataclass(frozen=True)
class LoopSettings:
    """How long and how often.

    Attributes:
        steps: Optimisation steps.
        log_every: Steps between entries in metrics.jsonl.
        checkpoint_every: Steps between checkpoints.
        label: What the progress bar says.
    """

    steps: int
    log_every: int = 50
    checkpoint_every: int = 1000
    label: str = "training"


def check_finite(tensors: Mapping[str, Tensor], step: int) -> None:
    """Looks for NaN and infinity.

    Raises:
        ModelError: Naming the first tensor that holds one.
    """
    for name, tensor in tensors.items():
        if tensor.is_floating_point() and not torch.isfinite(tensor).all():
            raise ModelError(
                f"'{name}' is not finite after step {step}: lower its learning rate, "
                "or look for damaged frames with ico3d capture check."
            )


def run_loop(trainee: Trainee, run: RunFolder, settings: LoopSettings) -> float:
    """Runs all steps that are left; the caller marks the run finished.

    Args:
        trainee: What to optimise.
        run: Where its checkpoint and metrics lie.
        settings: How long and how often.

    Returns:
        Seconds spent in steps, those before interruptions included.

    Raises:
        ModelError: If the loss or a parameter is not finite any more; the parameter is named.
    """
    first, seconds = _resume(trainee, run)
    log = MetricsLog(run.path, first)
    try:
        with progress_bar() as bar:
            task = bar.add_task(settings.label, total=settings.steps, completed=first, numbers="")
            for index in range(first, settings.steps):
                begin = time.perf_counter()
                values = trainee.step(index)
                seconds += time.perf_counter() - begin
                done = index + 1
                bar.advance(task)
                if not math.isfinite(float(values["loss"])):
                    check_finite(trainee.tensors(), index)
                    raise ModelError(f"the loss is not finite at step {index}.")
                if index % settings.log_every == 0 or done == settings.steps:
                    numbers = {name: float(value) for name, value in values.items()}
                    log.write(index, numbers)
                    bar.update(task, numbers=_readable(numbers))
                if done % settings.checkpoint_every == 0 and done < settings.steps:
                    check_finite(trainee.tensors(), index)
                    state = {"step": done, "seconds": seconds, "trainee": trainee.state()}
                    run.save_checkpoint(trainee.tensors(), state)
    finally:
        log.close()
    check_finite(trainee.tensors(), settings.steps - 1)
    return seconds


def _resume(trainee: Trainee, run: RunFolder) -> tuple[int, float]:
    """Restores the latest checkpoint; the step to go on with and the seconds spent before."""
    checkpoint = run.checkpoint()
    if checkpoint is None:
        return 0, 0.0
    tensors, state = checkpoint
    trainee.restore(tensors, state["trainee"])
    return state["step"], state["seconds"]


def _readable(numbers: Mapping[str, float]) -> str:
    """The numbers in the order the trainee gave them."""
    return "  ".join(f"{name} {value:.4g}" for name, value in numbers.items())
