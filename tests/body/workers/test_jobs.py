"""Windows trained by processes beside one another."""

import multiprocessing
import os
import pickle
import signal
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from ico3d.body.commands import TrainBody
from ico3d.body.workers.jobs import RETRIES, Lost, train_windows
from ico3d.body.workers.processes import Processes, Worker
from ico3d.errors import CaptureError, MissingExtraError, ModelError, SettingsError
from ico3d.training.finite import NotFiniteError
from ico3d.training.loop import saved_steps
from ico3d.training.processes import fork_server
from ico3d.training.run import CHECKPOINT
from support.bodies.window_tasks import (
    CHECKPOINT_EVERY,
    step_gone_on_from,
    tasks,
    wait_for,
    worker_of,
)

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("two_threads")]


class Disturbed(Processes):
    """Processes to one of which something happens as soon as it has a checkpoint."""

    def __init__(self, jobs, victim, disturb):
        super().__init__(jobs)
        self._victim, self._disturb = victim, disturb

    def start(self, task):
        super().start(task)
        if task == self._victim:
            names = {child.name: child.pid for child in multiprocessing.active_children()}
            self._pid = names[task.label]

    def ended(self, timeout):
        if self._victim is not None and wait_for(self._victim.folder / CHECKPOINT):
            self._victim = None
            self._disturb(self._pid)
        return super().ended(timeout)


def killed(pid):
    """The worst that can happen."""
    os.kill(pid, signal.SIGKILL)


def test_a_killed_worker_is_replaced_and_the_files_are_those_of_a_sequence(
    recorded, sequence, tmp_path, capsys, monkeypatch
):
    """Two at once, of two threads each; the second window's is lost in the middle of training."""
    monkeypatch.setattr("torch.get_num_threads", lambda: 4)  # the sequence had one
    made = tasks(recorded, tmp_path)
    seconds = train_windows(made, Disturbed(2, made[1], killed))
    assert [task.file.read_bytes() for task in made] == sequence
    assert len(seconds) == 3 and min(seconds) > 0
    said = capsys.readouterr().out
    step = step_gone_on_from(said, made[1], "was killed by SIGKILL")
    assert CHECKPOINT_EVERY <= step < made[1].steps
    assert "window 2 (frames 6 to 8): loss" in said, "the end of each window is told"


def interrupted(pid):
    """Ctrl-C, which reaches the worker as well as the one who started it."""
    os.kill(pid, signal.SIGINT)
    time.sleep(0.2)
    assert alive(pid), "the worker leaves that to its parent"
    signal.raise_signal(signal.SIGINT)


def alive(pid: int) -> bool:
    """Whether a process runs."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_ctrl_c_and_errors_end_all_workers_and_spare_checkpoints(recorded, tmp_path):
    """First the one, then, while the same window goes on, an error that a user can mend."""
    first, second, _ = tasks(recorded, tmp_path, "static", steps_per_frame=300)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may ignore it
    try:
        with pytest.raises(KeyboardInterrupt):
            train_windows([first], Disturbed(1, first, interrupted))
    finally:
        signal.signal(signal.SIGINT, before)
    assert not multiprocessing.active_children()
    saved = saved_steps(first.folder)
    assert CHECKPOINT_EVERY <= saved < first.steps
    second.folder.mkdir()
    (second.folder / "settings.json").write_text('{"settings": {}}')
    with pytest.raises(SettingsError, match="holds a run with another '"):
        train_windows([first, second], Processes(2, True))
    assert not multiprocessing.active_children()
    assert saved_steps(first.folder) >= saved


def test_an_error_of_the_program_is_shown_and_not_tried_again(recorded, tmp_path, capfd):
    """Only what is killed is replaced."""
    context = multiprocessing.get_context("fork")
    results, sender = context.Pipe(duplex=False)
    process = context.Process(target=lambda: 1 / 0)
    process.start()
    sender.close()
    worker = Worker(tasks(recorded, tmp_path)[1], 0, process, results)
    with pytest.raises(ModelError, match=r"window 1 .* the error that is printed above"):
        worker.outcome()
    assert capfd.readouterr().err.count("ZeroDivisionError: division by zero") == 1


def train_for_long(capture, folder):
    """What somebody does who has a worker, and is killed."""
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (to the end)
    long = tasks(capture, folder, "static", steps_per_frame=10_000)
    train_windows(long[:1], Processes(1, False))


def test_workers_end_with_the_one_who_started_them(recorded, tmp_path):
    """Even if that is killed: nobody would stop them, and who comes next writes the same files."""
    processes = fork_server("ico3d.body.workers.jobs")
    parent = processes.Process(target=train_for_long, args=(recorded, tmp_path))
    parent.start()
    task = tasks(recorded, tmp_path)[0]
    wait_for(task.folder / CHECKPOINT)
    worker = worker_of(task)
    assert alive(worker) and worker not in (parent.pid, os.getpid())
    parent.kill()
    parent.join()
    deadline = time.monotonic() + 60
    while alive(worker):
        assert time.monotonic() < deadline
        time.sleep(0.05)


class Hopeless:
    """A `Crew` whose workers are always lost."""

    capacity = 2

    def __init__(self):
        self.started, self.working, self.stopped = Counter(), [], False

    def expect(self, windows):
        pass

    def start(self, task):
        self.started[task.index] += 1
        self.working.append(task)

    def ended(self, timeout):
        return [(self.working.pop(0), Lost("was lost"))]

    def stop(self):
        self.stopped = True


def test_workers_are_not_replaced_for_ever(recorded, tmp_path):
    """A sentence that says which window, how often and after which step."""
    crew = Hopeless()
    with pytest.raises(
        ModelError, match=rf"window 0 .* was lost, {RETRIES + 1} times after step 0"
    ):
        train_windows(tasks(recorded, tmp_path), crew)
    assert crew.started[0] == RETRIES + 1 and crew.stopped


def test_a_gpu_for_each(monkeypatch):
    """By the names that the environment gives them; never two windows on one."""
    monkeypatch.setattr("torch.cuda.device_count", lambda: 2)
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "3,GPU-5")
    assert Processes(2, True)._gpus == ["3", "GPU-5"]
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES")
    assert Processes(2, True)._gpus == ["0", "1"]
    with pytest.raises(SettingsError, match="give --jobs 2 or fewer"):
        Processes(3, True)
    assert Processes(3, False)._gpus == []  # --device cpu


@pytest.mark.parametrize(
    "error",
    [CaptureError("No."), MissingExtraError("ray", "cluster", "x"), NotFiniteError("'means'")],
)
def test_errors_travel(error):
    """Class, sentence and attributes, whatever the constructor takes."""
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))


@pytest.mark.parametrize("wrong", [{"jobs": 0}, {"jobs": 2, "ray": "auto"}])
def test_impossible_jobs_are_refused_before_anything_is_done(wrong, tmp_path):
    """No process, or processes and a cluster."""
    with pytest.raises(SettingsError, match=f"--jobs {wrong['jobs']} is impossible"):
        TrainBody(tmp_path / "none", tmp_path / "out", **wrong).run()
    assert not (tmp_path / "out").exists()
