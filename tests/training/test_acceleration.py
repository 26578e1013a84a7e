"""Faster networks that compute the same."""

import getpass
import shutil
import tempfile
from pathlib import Path

import pytest
import torch
from torch import nn

from ico3d.errors import SettingsError
from ico3d.training.acceleration import accelerated

CPU = torch.device("cpu")


class Small(nn.Module):
    """A layer over rows of which some are parameters, as positions of Gaussians are."""

    def __init__(self, rows: int):
        super().__init__()
        self.layer = nn.Linear(3, 2)
        self.rows = nn.Parameter(torch.randn(rows, 3))

    def forward(self, offset: torch.Tensor) -> torch.Tensor:
        return nn.functional.leaky_relu(self.layer(self.rows + offset))


def test_on_the_cpu_mixed_precision_changes_nothing():
    network = Small(5)
    assert accelerated(network, CPU, mixed_precision=True, compiled=False) is network


def test_without_a_compiler_one_is_told(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    with pytest.raises(SettingsError, match=r"needs a C\+\+ compiler \(g\+\+ or clang\+\+\)"):
        accelerated(Small(5), CPU, mixed_precision=False, compiled=True)


@pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++")
@pytest.mark.slow
def test_compiled_networks_compute_the_same_whatever_the_number_of_rows(monkeypatch, tmp_path):
    from torch._inductor import codecache, config

    # What other users of the machine may make before us: code and headers there would be run.
    anybodys = Path(tempfile.gettempdir()) / f"torchinductor_{getpass.getuser()}"
    assert anybodys == Path(codecache._HEADER_DIR).parent
    before = {path: path.stat().st_mtime for path in anybodys.rglob("*")}
    monkeypatch.setenv("TORCHINDUCTOR_CACHE_DIR", str(tmp_path))  # nothing was compiled before
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr(config, "compile_threads", 1)  # one kernel is no work for eight processes
    monkeypatch.setattr(config.cpp, "vec_isa_ok", True)  # else each kind of vectors is tried first
    torch.manual_seed(0)
    network = Small(5)
    fast = accelerated(network, CPU, mixed_precision=False, compiled=True)
    compilations = torch._dynamo.utils.counters["stats"]
    already = compilations["unique_graphs"]
    with torch.no_grad():  # a backward pass takes as long again to compile
        for rows in range(5, 35, 3):  # more sizes than torch would compile one by one
            network.rows = nn.Parameter(torch.randn(rows, 3))
            offset = torch.randn(rows, 3)
            torch.testing.assert_close(fast(offset), network(offset))
    assert compilations["unique_graphs"] - already <= 2
    assert {path: path.stat().st_mtime for path in anybodys.rglob("*")} == before
    assert not list(tmp_path.rglob("*.gch"))
