"""The loop every optimisation runs in: resume, step, log, check, save."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import torch
from torch import Tensor

from ico3d.training.checkpoint import placed
from ico3d.training.finite import NotFiniteError, check_finite
from ico3d.training.log import MetricsLog, progress_bar, readable
from ico3d.training.run import RunFolder, checkpoint_state


class Trainee(Protocol):
    """What the loop optimises.

    All randomness of a step must follow from the seed and the step's number, so that a resumed
    run repeats the uninterrupted one.
    """

    def place(self, name: str) -> torch.device:
        """Where one of its tensors belongs: with the parameter that it is, or is about."""
        ...

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
        """Takes back what `tensors` and `state` gave; each tensor is at its place."""
        ...


class Watch(Protocol):
    """Somebody who looks on."""

    def after_step(self, done: int, values: Mapping[str, float | Tensor]) -> None:
        """Told when `done` steps are done, on the training thread, with the numbers of the last."""
        ...


@dataclass(frozen=True)
class LoopSettings:
    """How many steps a loop makes, and how often it writes something.

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


def run_loop(
    trainee: Trainee, run: RunFolder, settings: LoopSettings, watch: Watch | None = None
) -> float:
    """Runs all steps that are left; the caller marks the run finished.

    Args:
        trainee: The model with its optimiser.
        run: Where its checkpoint and metrics lie.
        settings: How many steps, and how often something is written.
        watch: Told after each step; its time does not count.

    Returns:
        Seconds spent in steps, those before interruptions included.

    Raises:
        ModelError: If the loss, a gradient or a parameter is not finite any more; it is named,
            and the latest checkpoint stays as it was.
    """
    first, seconds = _resume(trainee, run)
    log = MetricsLog(run.path, first)
    saved = index = first
    try:
        with progress_bar() as bar:
            task = bar.add_task(settings.label, total=settings.steps, completed=first, numbers="")
            for index in range(first, settings.steps):
                begin = time.perf_counter()
                values = trainee.step(index)
                seconds += time.perf_counter() - begin
                done = index + 1
                bar.advance(task)
                _check_loss(values, trainee)
                if index % settings.log_every == 0 or done == settings.steps:
                    check_finite(trainee.tensors())
                    numbers = {name: float(value) for name, value in values.items()}
                    log.write(index, numbers)
                    bar.update(task, numbers=readable(numbers))
                if watch is not None:
                    watch.after_step(done, values)
                if done % settings.checkpoint_every == 0 and done < settings.steps:
                    check_finite(trainee.tensors())
                    state = {"step": done, "seconds": seconds, "trainee": trainee.state()}
                    run.save_checkpoint(trainee.tensors(), state)
                    saved = done
    except NotFiniteError as error:
        raise error.at(index, saved) from error
    finally:
        log.close()
    return seconds


def _check_loss(values: Mapping[str, float | Tensor], trainee: Trainee) -> None:
    """Raises NotFiniteError if the loss is not finite; names the parameter that is to blame."""
    if not math.isfinite(float(values["loss"])):
        check_finite(trainee.tensors())
        raise NotFiniteError("the loss")


def _resume(trainee: Trainee, run: RunFolder) -> tuple[int, float]:
    """Restores the latest checkpoint; the step to go on with and the seconds spent before."""
    checkpoint = run.checkpoint()
    if checkpoint is None:
        return 0, 0.0
    tensors, state = checkpoint
    trainee.restore(placed(tensors, trainee.place), state["trainee"])
    return state["step"], state["seconds"]


def saved_steps(folder: Path) -> int:
    """Steps that a run has behind it at its latest checkpoint; somebody may be running it."""
    state = checkpoint_state(folder)
    return 0 if state is None else state["step"]
