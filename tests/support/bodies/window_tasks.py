"""Windows to train by whoever shall be tested, and what they must become."""

import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import numba

from ico3d.body.planning.windows import Window
from ico3d.body.settings import settings_for
from ico3d.body.training.train_clip import BodyJob, WindowTask, train_window
from ico3d.training.log import METRICS
from ico3d.training.processes import fork_server

WINDOWS = (Window(0, 3), Window(3, 6), Window(6, 8))
STEPS_PER_FRAME = 15
CHECKPOINT_EVERY = 10


def tasks(capture: Path, folder: Path, method="swings++", **changes) -> list[WindowTask]:
    """Three tiny windows."""
    settings = settings_for("cpu", method)
    settings = replace(
        settings,
        steps_per_frame=STEPS_PER_FRAME,
        warmup_steps=10,
        cache_gib=0.1,
        checkpoint_every=CHECKPOINT_EVERY,
        initial=replace(settings.initial, gaussians=200),
        density=replace(settings.density, max_gaussians=400, begin=20, every=20),
        encoder=replace(settings.encoder, space=8),
        mlp=replace(settings.mlp, width=32),
    )
    job = BodyJob(method, 0, replace(settings, **changes))
    return [
        WindowTask(capture, folder / f"{index:04d}", folder / "flow", window, index, job)
        for index, window in enumerate(WINDOWS)
    ]


def step_gone_on_from(said: str, task: WindowTask, reason: str) -> int:
    """The step in what was said when a window lost its worker."""
    _, found, rest = said.partition(
        f"{task.label}: its worker {reason}; another goes on from step "
    )
    assert found, said
    return int(rest.partition(".")[0])


def wait_for(file: Path) -> bool:
    """Waits until a file is there."""
    for _ in range(60_000):
        if file.exists():
            return True
        time.sleep(0.002)
    raise TimeoutError(file)


def worker_of(task) -> int:
    """The process that writes a window's metrics."""
    for link in Path("/proc").glob("[0-9]*/fd/*"):
        try:
            if link.readlink() == task.folder / METRICS:
                return int(link.parts[2])
        except OSError:
            continue  # somebody else's, or closed in the meantime
    raise AssertionError("nobody trains this window")


def files_of_a_sequence(capture: Path, folder: Path) -> list[bytes]:
    """What the windows are if one after another trains in one process.

    A process that has just compiled a kernel rounds otherwise than one that finds it compiled, as
    all later ones do: the first trains briefly, for the compiled code alone. Windows that the
    folder holds already are not trained again.
    """
    files = [task.file for task in tasks(capture, folder / "trained")]
    if all(file.exists() for file in files):
        return [file.read_bytes() for file in files]
    processes = fork_server("ico3d.body.workers.jobs")
    for name, changes in (("compiled", {"steps_per_frame": 8}), ("trained", {})):
        process = processes.Process(target=_one_by_one, args=(capture, folder / name, changes))
        process.start()
        process.join()
        assert process.exitcode == 0
    return [file.read_bytes() for file in files]


def _one_by_one(capture: Path, folder: Path, changes: dict) -> None:
    """What such a process does, on one thread."""
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (to the end)
    numba.set_num_threads(1)
    for task in tasks(capture, folder, **changes):
        train_window(task)
