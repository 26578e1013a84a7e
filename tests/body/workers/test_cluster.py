"""Windows trained by a Ray cluster: two nodes on this machine."""

import os
import signal
import sys
import tempfile

import pytest

from ico3d.body.workers.cluster import RayCluster, _own, share
from ico3d.body.workers.jobs import train_windows
from ico3d.errors import MissingExtraError, SettingsError
from ico3d.training.run import CHECKPOINT
from support.bodies.window_tasks import (
    CHECKPOINT_EVERY,
    step_gone_on_from,
    tasks,
    wait_for,
    worker_of,
)

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("two_threads")]


def node(alive=True, **resources):
    """A machine as Ray describes it."""
    return {"Alive": alive, "Resources": {**resources, "memory": 1e9}}


@pytest.mark.parametrize(
    ("nodes", "windows", "cores", "gpus"),
    [
        ([node(CPU=2.0)], 3, 1, 0),
        ([node(CPU=16.0), node(CPU=8.0)], 3, 8, 0),  # no more than the smaller has
        ([node(CPU=16.0), node(CPU=16.0)], 15, 2, 0),
        ([node(CPU=16.0), node(alive=False, CPU=1.0), node()], 2, 8, 0),
        ([node(CPU=16.0, GPU=4.0), node(CPU=4.0, GPU=2.0), node(CPU=64.0)], 15, 2, 1),
        ([node(CPU=2.0, GPU=4.0)], 3, 1, 1),
    ],
)
def test_shares(nodes, windows, cores, gpus):
    """A GPU where there are any, and cores so that each machine can take a window."""
    assert share(nodes, windows) == {"num_cpus": cores, "num_gpus": gpus}
    assert share(nodes, windows, with_gpus=False)["num_gpus"] == 0


def test_nobody_can_work():
    """One sentence."""
    with pytest.raises(SettingsError, match="no machine with cores"):
        share([node(alive=False, CPU=4.0), node(GPU=1.0)], 3)


def test_ray_is_not_there(monkeypatch):
    """One sentence that says what to install."""
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingExtraError, match=r"ico3d\[cluster\]"):
        RayCluster("auto")


@pytest.fixture(scope="module")
def address():
    """Of a cluster of two nodes with a core each, which only this machine reaches."""
    patch = pytest.MonkeyPatch()
    patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    patch.setenv("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")  # Ray's way to say: loopback only
    patch.setenv("RAY_worker_niceness", "0")  # else whatever else is tested takes all cores first
    ray_cluster = pytest.importorskip("ray.cluster_utils", reason="ray is not installed")
    small = {"num_cpus": 1, "object_store_memory": 80 * 2**20, "include_log_monitor": False}
    with tempfile.TemporaryDirectory(prefix="ray", ignore_cleanup_errors=True) as folder:
        patch.setenv("RAY_TMPDIR", folder)  # not pytest's: names of sockets must be short
        cluster = ray_cluster.Cluster()
        cluster.add_node(**small, include_dashboard=False, no_monitor=True)
        cluster.add_node(**small)
        yield cluster.address
        cluster.shutdown()
    patch.undo()


class Disturbed(RayCluster):
    """A cluster that loses the worker of one window as soon as that has a checkpoint."""

    victim = None

    def ended(self, timeout):
        if self.victim is not None:
            wait_for(self.victim.folder / CHECKPOINT)
            os.kill(worker_of(self.victim), signal.SIGKILL)
            self.victim = None
        return super().ended(timeout)


def test_auto_is_ones_own_cluster_and_nobody_elses(address, monkeypatch):
    """Ray would join whatever cluster runs on this machine."""
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    assert _own() == address
    monkeypatch.setattr(os, "getuid", lambda: 12_345)
    with pytest.raises(SettingsError, match="no Ray cluster answers at auto: start one"):
        RayCluster("auto")
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:9")
    assert _own() == "127.0.0.1:9"


def test_the_same_files(address, recorded, sequence, tmp_path, capsys):
    """As by one process, though a worker is killed in the middle."""
    assert address.startswith("127.0.0.1:")
    made = tasks(recorded, tmp_path)
    crew = Disturbed(address)
    crew.victim = made[1]
    train_windows(made, crew)
    assert [task.file.read_bytes() for task in made] == sequence
    step = step_gone_on_from(capsys.readouterr().out, made[1], "was lost (WorkerCrashedError)")
    assert CHECKPOINT_EVERY <= step < made[1].steps


def test_nobody_answers():
    """One sentence, at once."""
    pytest.importorskip("ray", reason="ray is not installed")
    with pytest.raises(SettingsError, match=r"no Ray cluster answers at 127\.0\.0\.1:9"):
        RayCluster("127.0.0.1:9")
