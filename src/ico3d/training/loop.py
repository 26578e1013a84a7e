"""The loop of every training: resume, step, log, check, save."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import torch
from torch import Tensor

from ico3d.common.files import full_disk
from ico3d.errors import ModelError
from ico3d.training.checkpoint import placed
from ico3d.training.devices import device_failure
from ico3d.training.finite import NotFiniteError, check_finite
from ico3d.training.log import MetricsLog, progress_bar, readable
from ico3d.training.run import RunFolder, checkpoint_state

UNFIT = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError)
"""What restoring raises where a checkpoint does not fit; what a GPU raises is none of it."""


class Trainee(Protocol):
    """A model with its optimiser, as the training loop sees them.

    All randomness of a step must depend on the seed and the step's number alone, so that a resumed
    run repeats an uninterrupted one.
    """

    def place(self, name: str) -> torch.device:
        """The device of the tensor `name` of `tensors`; moments lie with their parameter."""
        ...

    def step(self, index: int) -> Mapping[str, float | Tensor]:
        """Does optimisation step `index`; returns numbers to log, among them `loss`."""
        ...

    def tensors(self) -> dict[str, Tensor]:
        """All tensors that steps change, by name: parameters and the optimiser's moments."""
        ...

    def state(self) -> dict:
        """Everything else that steps change, JSON-serialisable."""
        ...

    def restore(self, tensors: dict[str, Tensor], state: dict) -> None:
        """Restores what `tensors` and `state` returned; each tensor is on the device of `place`."""
        ...


class Watch(Protocol):
    """An observer of a training, such as a live page."""

    def after_step(self, done: int, values: Mapping[str, float | Tensor]) -> None:
        """Called on the training thread when `done` steps are done; `values` are the last's."""
        ...


@dataclass(frozen=True)
class LoopSettings:
    """Number of steps of a training loop, and how often the loop logs and saves.

    Attributes:
        steps: Optimisation steps.
        log_every: Steps between entries in metrics.jsonl.
        checkpoint_every: Steps between checkpoints.
        label: Text beside the progress bar.
    """

    steps: int
    log_every: int = 50
    checkpoint_every: int = 1000
    label: str = "training"


def run_loop(
    trainee: Trainee, run: RunFolder, settings: LoopSettings, watch: Watch | None = None
) -> float:
    """Runs all remaining steps; the caller marks the run as finished.

    Args:
        trainee: The model with its optimiser.
        run: The folder of the run's checkpoint and metrics.
        settings: Number of steps, and how often to log and save.
        watch: Observer that is called after each step; the time it takes is not counted.

    Returns:
        Seconds spent in steps, including those before interruptions.

    Raises:
        ModelError: If the loss, a gradient or a parameter is no longer finite; the sentence names
            the tensor, and the latest checkpoint is kept. Or if all checkpoints are damaged.
        DeviceError: If the GPU fails; the latest checkpoint is kept.
        StorageError: If the disk is full; the latest checkpoint is kept.
    """
    with full_disk(run.path):
        run.expect(settings.steps)
        return _run_steps(trainee, run, settings, watch)


def _run_steps(
    trainee: Trainee, run: RunFolder, settings: LoopSettings, watch: Watch | None
) -> float:
    """Does what `run_loop` promises, except on a full disk."""
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
    except RuntimeError as error:
        failure = device_failure(error, index, saved)
        if failure is None:
            raise
        raise failure from error
    finally:
        log.close()
    return seconds


def _check_loss(values: Mapping[str, float | Tensor], trainee: Trainee) -> None:
    """Raises NotFiniteError if the loss is not finite; names the parameter that is to blame."""
    if not math.isfinite(float(values["loss"])):
        check_finite(trainee.tensors())
        raise NotFiniteError("the loss")


def _resume(trainee: Trainee, run: RunFolder) -> tuple[int, float]:
    """Restores the latest usable checkpoint; its step, and the seconds spent until then."""
    checkpoint = run.checkpoint(trainee.tensors().keys())
    if checkpoint is None:
        return 0, 0.0
    tensors, state = checkpoint
    try:
        trainee.restore(placed(tensors, trainee.place), state["trainee"])
        return state["step"], float(state["seconds"])
    except UNFIT as error:
        raise ModelError(
            f"the checkpoint in {run.path} is of another training ({error}): choose another "
            "folder, or remove it to start afresh."
        ) from error


def saved_steps(folder: Path) -> int:
    """Number of steps in a run's latest checkpoint; safe while the run is going on."""
    state = checkpoint_state(folder)
    return 0 if state is None else state["step"]
