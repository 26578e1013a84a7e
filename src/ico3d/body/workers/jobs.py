"""Windows trained beside one another by workers, which may be lost and are replaced.

No window depends on another, and each goes on from its own checkpoint. So a worker that is lost
costs the steps since then, and how many workers there are changes nothing about the result: what a
step computes on the CPU does not depend on the number of threads.
"""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numba
import torch

from ico3d.body.training.train_clip import WindowTask, train_window
from ico3d.body.workers.overview import Overview
from ico3d.errors import Ico3dError, ModelError
from ico3d.training.loop import saved_steps

RETRIES = 3
"""Workers that a window may lose after one and the same checkpoint and still get another."""
PERIOD = 1.0
"""Seconds between two looks at what the workers do."""


@dataclass(frozen=True)
class Lost:
    """A worker has ended without a word.

    Attributes:
        reason: What is known of why, to follow "its worker".
    """

    reason: str


class Crew(Protocol):
    """Workers, each of which trains one window."""

    @property
    def capacity(self) -> int | None:
        """How many windows they take at once; None if they keep a queue themselves."""
        ...

    def expect(self, windows: int) -> None:
        """Told how many windows there will be, before the first: the cores are shared out."""
        ...

    def start(self, task: WindowTask) -> None:
        """Has a worker train a window."""
        ...

    def ended(self, timeout: float) -> Sequence[tuple[WindowTask, float | Lost]]:
        """Waits until a worker ends, so many seconds at most.

        Returns:
            The windows that have ended, with their seconds of training.

        Raises:
            Ico3dError: The error that ended a worker.
        """
        ...

    def stop(self) -> None:
        """Ends all workers at once."""
        ...


def train_windows(tasks: Sequence[WindowTask], crew: Crew) -> list[float]:
    """Trains windows, and shows how far they are.

    Args:
        tasks: The windows to train.
        crew: Who does it; is stopped at the end, however that comes.

    Returns:
        Seconds spent in steps, by window.

    Raises:
        Ico3dError: The first that a worker meets; the others' checkpoints stay.
        ModelError: Also if workers are lost again and again.
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
    """Counts a loss and says so.

    Raises:
        ModelError: If there were too many since the window's latest checkpoint.
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
    """What a worker does; what a user can mend is a result, too.

    Args:
        task: The window to train.
        threads: Threads of its kernels.
    """
    torch.set_num_threads(threads)
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))  # type: ignore (set at run time)
    try:
        return train_window(task)
    except Ico3dError as error:
        return error
