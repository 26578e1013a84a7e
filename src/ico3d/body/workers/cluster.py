"""Trains windows on a Ray cluster.

Capture and model folder must have the same path on all nodes (a shared folder), and ico3d must be
installed on each. Workers return results through Ray; their progress is read from the model folder.
"""

import logging
import os
import socket
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil

from ico3d.body.training.train_clip import WindowTask
from ico3d.body.workers.jobs import Lost, work
from ico3d.common.files import resolved
from ico3d.errors import Ico3dError, MissingExtraError, SettingsError

ANSWER = 10.0
"""Seconds within which a cluster must accept a connection."""
AUTO = "auto"
RAYLET, GCS = "raylet", "--gcs-address="
"""Ray's process on each machine of a cluster, and the word that tells the cluster's address."""


class RayCluster:
    """A `Crew` of Ray workers; Ray itself queues windows that cannot start yet."""

    capacity = None

    def __init__(self, address: str, with_gpus: bool = True):
        """Connects to a cluster.

        Args:
            address: Address of the cluster: host:port, or "auto" on one of its machines, for the
                cluster that the environment names (RAY_ADDRESS), or else the user's own.
            with_gpus: Whether each window gets a GPU, if the cluster has GPUs.

        Raises:
            MissingExtraError: If Ray is not installed.
            SettingsError: If no cluster answers at this address.
        """
        try:
            import ray
        except ImportError:
            raise MissingExtraError("ray", "cluster", "training on a Ray cluster") from None
        self._ray: Any = ray
        try:
            found = _own() if address == AUTO else address
            _reach(found)
            ray.init(address=found, log_to_driver=False, logging_level=logging.WARNING)
        except (OSError, ValueError, RuntimeError) as error:
            raise SettingsError(
                f"no Ray cluster answers at {address}: start one with ray start --head, or give "
                "the address of one."
            ) from error
        self._with_gpus = with_gpus
        self._needs: dict[str, int] = {}
        self._running: dict[Any, WindowTask] = {}

    def expect(self, windows: int) -> None:
        """Divides the machines' cores and GPUs among this number of windows.

        Raises:
            SettingsError: If no machine has cores to give.
        """
        self._needs = share(self._ray.nodes(), windows, self._with_gpus)

    def start(self, task: WindowTask) -> None:
        """Submits a window to Ray."""
        capture, folder, flow = map(resolved, (task.capture, task.folder, task.flow))
        there = replace(task, capture=capture, folder=folder, flow=flow)
        # No retries by Ray: they would be neither counted per checkpoint nor shown.
        remote = self._ray.remote(max_retries=0, **self._needs)(work)
        self._running[remote.remote(there, self._needs["num_cpus"])] = task

    def ended(self, timeout: float) -> Sequence[tuple[WindowTask, float | Lost]]:
        """Waits at most `timeout` seconds until a window ends or its worker is lost.

        Raises:
            Ico3dError: The error that ended a worker.
        """
        ready, _ = self._ray.wait(list(self._running), timeout=timeout)
        return [(self._running.pop(reference), self._outcome(reference)) for reference in ready]

    def _outcome(self, reference: Any) -> float | Lost:
        """Seconds of training of a worker that ended, or why it was lost.

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


def _own() -> str:
    """Address of the cluster that the environment names, or to which this user's processes belong.

    Ray itself joins any cluster that runs on the machine, and runs what that answers; whoever uses
    the machine as well may have begun one.

    Raises:
        ValueError: If there is none, or more than one.
    """
    named = os.environ.get("RAY_ADDRESS", AUTO)
    if named != AUTO:
        return named
    found: set[str] = set()
    for process in psutil.process_iter(["uids", "cmdline"]):
        uids, words = process.info["uids"], process.info["cmdline"]
        if not words or not uids or uids.real != os.getuid() or Path(words[0]).name != RAYLET:
            continue
        found |= {one.removeprefix(GCS) for one in words if one.startswith(GCS)}
    (address,) = found
    return address


def _reach(address: str) -> None:
    """Tests whether an address accepts connections; without this test Ray would wait for minutes.

    Raises:
        OSError: If the address does not accept a connection.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if port.isdigit():  # else Ray judges it
        socket.create_connection((host, int(port)), ANSWER).close()


def share(nodes: Sequence[Mapping], windows: int, with_gpus: bool = True) -> dict[str, int]:
    """Resources of a cluster for each window: a GPU if there are any, and its share of the cores.

    Args:
        nodes: Nodes as Ray describes them, with keys "Alive" and "Resources".
        windows: Number of windows to train.
        with_gpus: Whether GPUs are wanted.

    Returns:
        `num_cpus` and `num_gpus` of each window, such that every node (every node with GPUs, if
        they are used) can train one.

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
