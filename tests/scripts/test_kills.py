"""The bench of kills compares what it should, and counts what differs."""

import json
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[2] / "bench"


@pytest.fixture(scope="module")
def bench():
    """The script as a module; its classes need it in the list of modules."""
    spec = spec_from_file_location("bench_kills", BENCH / "kills" / "__main__.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "bench_kills", module)
        spec.loader.exec_module(module)
        yield module


def test_all_of_a_run_is_compared_but_what_time_decides(bench, tmp_path):
    for name, seconds in (("a", 1.5), ("b", 2.5)):
        folder = tmp_path / name
        (folder / "windows" / "tensorboard").mkdir(parents=True)
        (folder / "windows" / "tensorboard" / f"events.{name}").write_text(name)
        (folder / "state.json").write_text(name)
        about = {"summary": {"train_seconds": seconds, "parts": [{"train_seconds": seconds}]}}
        (folder / "body.json").write_text(json.dumps(about))
        (folder / "windows" / "window.safetensors").write_bytes(b"the same")
    first, second = (dict(bench.contents(tmp_path / name)) for name in "ab")
    assert first == second and set(first) == {"body.json", "windows/window.safetensors"}
    (tmp_path / "b" / "windows" / ".window.0123456789abcdef.safetensors").touch()
    assert first != dict(bench.contents(tmp_path / "b")), "what a kill has left counts"


def test_a_run_that_differs_costs_all_its_kills(bench):
    tally = bench.Tally(kills=7, early=1, writing=2, runs=[4, 3], files=6)
    assert bench.table({"head": tally}).endswith("| head | 7 | 1 | 2 | 2 | 4 | 6 | 7 of 7 |")
    tally.other["head-1"] = ["model.safetensors"]
    assert bench.table({"head": tally}).endswith("| 4 of 7 |")
