"""Trains windows in parallel by workers; workers that are lost are replaced.

Windows are independent, and each continues from its own checkpoint: a lost worker costs only the
steps since the last checkpoint. The number of workers does not change the result, as a step on the
CPU computes the same with any number of threads.
"""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import torch

from ico3d.body.training.train_clip import WindowTask, train_window
from ico3d.body.workers.overview import Overview
from ico3d.common.native.jit import numba
from ico3d.errors import Ico3dError, ModelError
from ico3d.training.loop import saved_steps

RETRIES = 3
"""Number of workers of a window that may be lost after the same checkpoint and are replaced."""
PERIOD = 1.0
"""Seconds between two updates of the progress."""


@dataclass(frozen=True)
class Lost:
    """The outcome of a worker that ended without a result.

    Attributes:
        reason: How it ended, in words that continue a sentence after "its worker".
    """

    reason: str


class Crew(Protocol):
    """Workers, each of which trains one window."""

    @property
    def capacity(self) -> int | None:
        """Number of windows that can be trained at once; None if the crew queues windows itself."""
        ...

    def expect(self, windows: int) -> None:
        """Called before the first window with the number of windows, to divide the cores."""
        ...

    def start(self, task: WindowTask) -> None:
        """Starts the training of a window by a worker."""
        ...

    def ended(self, timeout: float) -> Sequence[tuple[WindowTask, float | Lost]]:
        """Waits at most `timeout` seconds until a worker ends.

        Returns:
            Windows whose workers have ended, with seconds of training, or why the worker was lost.

        Raises:
            Ico3dError: The error that ended a worker.
        """
        ...

    def stop(self) -> None:
        """Ends all workers immediately."""
        ...


def train_windows(tasks: Sequence[WindowTask], crew: Crew) -> list[float]:
    """Trains windows by a crew of workers, and shows their progress.

    Args:
        tasks: The windows to train.
        crew: Workers, which are stopped in the end, also after an error.

    Returns:
        Seconds spent in optimisation steps, for each window.

    Raises:
        Ico3dError: The first error of a worker; the checkpoints of all windows are kept.
        ModelError: If a window loses more than `RETRIES` workers after the same checkpoint.
    """
    waiting, running, losses = deque(tasks), 0, Counter()
    seconds: dict[int, float] = {}
    with Overview(tasks) as overview:
        try:
            crew.expect(len(tasks))
            while len(seconds) < len(tasks):
                while waiting and (crew.capacity is None or running < crew.capacity):
                    crew.start(waiting.popleft())
                    running += 1
                for task, outcome in crew.ended(PERIOD):
                    running -= 1
                    if isinstance(outcome, Lost):
                        _count(task, outcome, losses, overview)
                        waiting.appendleft(task)
                    else:
                        seconds[task.index] = outcome
                overview.refresh()
        finally:
            crew.stop()
    return [seconds[task.index] for task in tasks]


def _count(task: WindowTask, lost: Lost, losses: Counter, overview: Overview) -> None:
    """Counts a lost worker of a window and prints a line about it.

    Raises:
        ModelError: If more than `RETRIES` were lost since the window's latest checkpoint.
    """
    step = saved_steps(task.folder)
    losses[task.index, step] += 1
    if losses[task.index, step] > RETRIES:
        raise ModelError(
            f"{task.label}: its worker {lost.reason}, {RETRIES + 1} times after step {step}: "
            "look for a lack of memory (fewer at once need less), then run the same command again."
        )
    overview.say(f"{task.label}: its worker {lost.reason}; another goes on from step {step}.")


def work(task: WindowTask, threads: int) -> float | Ico3dError:
    """Trains a window in a worker.

    Args:
        task: The window to train.
        threads: Number of threads for torch and numba.

    Returns:
        Seconds spent in optimisation steps; an error of ico3d is returned instead of raised.
    """
    torch.set_num_threads(threads)
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))  # type: ignore (set at run time)
    try:
        return train_window(task)
    except Ico3dError as error:
        return error
