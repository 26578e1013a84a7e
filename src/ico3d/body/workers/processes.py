"""Trains windows in processes on this machine."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

import torch

from ico3d.body.training.train_clip import WindowTask
from ico3d.body.workers.jobs import Lost, work
from ico3d.errors import Ico3dError, ModelError, SettingsError
from ico3d.training.processes import fork_server

GPUS = "CUDA_VISIBLE_DEVICES"
"""Environment variable that tells CUDA which GPUs a process may use."""


@dataclass(frozen=True)
class Worker:
    """A process that trains one window.

    Attributes:
        task: The window.
        place: Slot of the worker, from 0 to one less than the number of processes at once.
        process: The process.
        results: Connection over which the process sends its result.
    """

    task: WindowTask
    place: int
    process: BaseProcess
    results: Connection

    def outcome(self) -> float | Lost:
        """Seconds of training, or why the worker was lost; waits until the worker has ended.

        Raises:
            Ico3dError: The error that ended the worker.
            ModelError: If the process ended with an unexpected error.
        """
        try:
            result = self.results.recv()
        except (EOFError, ConnectionError):
            result = None
        self.process.join()
        code = self.process.exitcode or 0
        if isinstance(result, Ico3dError):
            raise result
        if result is not None:
            return result
        if code < 0:
            return Lost(f"was killed by {signal.Signals(-code).name}")
        raise ModelError(
            f"{self.task.label}: its worker ended with the error that is printed above; the same "
            "command goes on from the latest checkpoints."
        )


class Processes:
    """A `Crew` of processes, each with its share of the cores and, with CUDA, its own GPU."""

    def __init__(self, jobs: int, with_gpus: bool = True):
        """Makes a crew that has started no process yet.

        Args:
            jobs: Number of processes at once.
            with_gpus: Whether each process gets a GPU, if the machine has GPUs.

        Raises:
            SettingsError: If there are GPUs, but fewer than `jobs`.
        """
        self._gpus = _gpus() if with_gpus else []
        if self._gpus and jobs > len(self._gpus):
            raise SettingsError(
                f"{jobs} windows at once need a GPU each, and this machine has {len(self._gpus)}: "
                f"give --jobs {len(self._gpus)} or fewer."
            )
        self.capacity = jobs
        self._threads = 1
        self._context = fork_server("ico3d.body.workers.jobs")
        self._workers: list[Worker] = []

    def expect(self, windows: int) -> None:
        """Divides the cores among the processes that work at once."""
        self._threads = max(torch.get_num_threads() // min(self.capacity, windows), 1)

    def start(self, task: WindowTask) -> None:
        """Starts a process for a window."""
        taken = {worker.place for worker in self._workers}
        place = min(set(range(self.capacity)) - taken)
        gpu = self._gpus[place] if self._gpus else None
        results, sender = self._context.Pipe(duplex=False)
        process = self._context.Process(
            target=_main, args=(sender, task, self._threads, gpu), name=task.label, daemon=True
        )
        process.start()
        sender.close()  # so only the worker holds this end, which closes however the worker ends
        self._workers.append(Worker(task, place, process, results))

    def ended(self, timeout: float) -> Sequence[tuple[WindowTask, float | Lost]]:
        """Waits at most `timeout` seconds until a process has sent a result or has ended.

        Raises:
            Ico3dError: The error that ended a worker.
        """
        ready = wait([worker.results for worker in self._workers], timeout)
        ended = [worker for worker in self._workers if worker.results in ready]
        outcomes = [(worker.task, worker.outcome()) for worker in ended]
        self._workers = [worker for worker in self._workers if worker not in ended]
        return outcomes

    def stop(self) -> None:
        """Kills all processes; this leaves no broken files, as they are written atomically."""
        for worker in self._workers:
            worker.process.kill()
        for worker in self._workers:
            worker.process.join()
        self._workers.clear()


def _gpus() -> list[str]:
    """Names of the GPUs that this process may use, as in `GPUS`; none without CUDA."""
    named = os.environ.get(GPUS, "")
    names = [name for name in named.split(",") if name] or list(map(str, range(64)))
    return names[: torch.cuda.device_count()]


def _main(sender: Connection, task: WindowTask, threads: int, gpu: str | None) -> None:
    """Main function of a worker's process: trains a window and sends the result."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; parent decides
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (open to the end); the parent shows progress
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if gpu is not None:
        os.environ[GPUS] = gpu  # CUDA reads it at its first use, which is later
    sender.send(work(task, threads))


def _end_with_parent() -> None:
    """Ends this process when its parent process is gone, as nobody waits for the result then."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
