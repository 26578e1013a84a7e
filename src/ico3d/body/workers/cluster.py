"""Windows trained by a Ray cluster.

Captures and model folders lie where all nodes find them under the same path (a shared folder), and
ico3d is installed on each. Workers answer through Ray; how far they are is read from the folder.
"""

import logging
import socket
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ico3d.body.training.train_clip import WindowTask
from ico3d.body.workers.jobs import Lost, work
from ico3d.errors import Ico3dError, MissingExtraError, SettingsError

ANSWER = 10.0
"""Seconds within which a cluster must answer."""


class RayCluster:
    """A `Crew` of Ray workers; Ray keeps the queue."""

    capacity = None

    def __init__(self, address: str, with_gpus: bool = True):
        """Connects.

        Args:
            address: Of the cluster: host:port, or "auto" on one of its machines.
            with_gpus: Whether each window gets a GPU, where there are any.

        Raises:
            MissingExtraError: If Ray is not installed.
            SettingsError: If there is no cluster at this address.
        """
        try:
            import ray
        except ImportError:
            raise MissingExtraError("ray", "cluster", "training on a Ray cluster") from None
        self._ray: Any = ray
        try:
            _reach(address)
            ray.init(address=address, log_to_driver=False, logging_level=logging.WARNING)
        except (OSError, ValueError, RuntimeError) as error:
            raise SettingsError(
                f"no Ray cluster answers at {address}: start one with ray start --head."
            ) from error
        self._with_gpus = with_gpus
        self._needs: dict[str, int] = {}
        self._running: dict[Any, WindowTask] = {}

    def expect(self, windows: int) -> None:
        """Shares out what the machines have.

        Raises:
            SettingsError: If none can work.
        """
        self._needs = share(self._ray.nodes(), windows, self._with_gpus)

    def start(self, task: WindowTask) -> None:
        """Gives Ray a window to train."""
        places = {name: getattr(task, name).resolve() for name in ("capture", "folder", "flow")}
        # Not Ray's own retries: those would be neither counted by checkpoint nor seen.
        remote = self._ray.remote(max_retries=0, **self._needs)(work)
        self._running[remote.remote(replace(task, **places), self._needs["num_cpus"])] = task

    def ended(self, timeout: float) -> Sequence[tuple[WindowTask, float | Lost]]:
        """Waits until Ray has a result, or has lost a worker or its machine."""
        ready, _ = self._ray.wait(list(self._running), timeout=timeout)
        return [(self._running.pop(reference), self._outcome(reference)) for reference in ready]

    def _outcome(self, reference: Any) -> float | Lost:
        """How a worker ended.

        Raises:
            Ico3dError: The error that ended the worker.
        """
        errors = self._ray.exceptions
        lost = (errors.WorkerCrashedError, errors.NodeDiedError, errors.OutOfMemoryError)
        try:
            result = self._ray.get(reference)
        except lost as error:
            return Lost(f"was lost ({type(error).__name__})")
        if isinstance(result, Ico3dError):
            raise result
        return result

    def stop(self) -> None:
        """Ends all workers and leaves the cluster."""
        for reference in self._running:
            self._ray.cancel(reference, force=True)
        self._ray.shutdown()


def _reach(address: str) -> None:
    """Connects to an address and hangs up: where nobody answers, Ray would wait for minutes.

    Raises:
        OSError: If nobody answers.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if port.isdigit():  # others are words like "auto"
        socket.create_connection((host, int(port)), ANSWER).close()


def share(nodes: Sequence[Mapping], windows: int, with_gpus: bool = True) -> dict[str, int]:
    """What each window gets of a cluster: a GPU where there are any, and its part of the cores.

    Args:
        nodes: As Ray describes them: whether "Alive", and their "Resources".
        windows: How many windows are to be trained.
        with_gpus: Whether GPUs are wanted.

    Returns:
        `num_cpus` and `num_gpus` for each, such that every node can take one.

    Raises:
        SettingsError: If no node has cores to give.
    """
    resources = [node["Resources"] for node in nodes if node["Alive"]]
    resources = [held for held in resources if held.get("CPU", 0) >= 1]
    if not resources:
        raise SettingsError("the Ray cluster has no machine with cores to give.")
    with_gpu = [held for held in resources if with_gpus and held.get("GPU", 0) >= 1]
    if with_gpu:
        cores = min(held["CPU"] // held["GPU"] for held in with_gpu)
        return {"num_cpus": max(int(cores), 1), "num_gpus": 1}
    cores = sum(held["CPU"] for held in resources) // windows
    most = min(held["CPU"] for held in resources)
    return {"num_cpus": int(max(min(cores, most), 1)), "num_gpus": 0}
