"""Disks that are full and GPUs that fail: one sentence, and the run resumes exactly."""

import shutil
import tracemalloc

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save

from ico3d.common.files import SPARE
from ico3d.errors import DeviceError, StorageError
from ico3d.training.checkpoint import (
    DTYPES,
    load_tensors,
    save_sealed,
    save_tensors,
    size_of_tensors,
)
from ico3d.training.loop import LoopSettings, run_loop
from ico3d.training.run import RunFolder
from support.full_disk import files_of_at_most
from training.walk import Walk

SETTINGS = LoopSettings(steps=20, log_every=5, checkpoint_every=4)


class Broad(Walk):
    """A walk with a tensor of 800 kB, with moments that are not contiguous."""

    def tensors(self) -> dict[str, torch.Tensor]:
        wide = torch.full((1000, 100), float(self.calls)).T
        return super().tensors() | {"wide": wide, "other": 2 * wide}

    def restore(self, tensors: dict[str, torch.Tensor], state: dict) -> None:
        assert tensors.pop("wide").max() == state["calls"]
        assert tensors.pop("other").max() == 2 * state["calls"]
        super().restore(tensors, state)


def test_a_model_of_whomever_leaves_room_on_the_disk(tmp_path, monkeypatch):
    usage, path = shutil.disk_usage(tmp_path), tmp_path / "model.safetensors"
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=SPARE + 400))
    for save_one in (save_tensors, save_sealed):
        save_one(path, {"a": torch.zeros(100)}, {})
        with pytest.raises(StorageError, match=r"model\.safetensors cannot be written") as told:
            save_one(path, {"a": torch.zeros(101)}, {})
        assert told.value.code == "disk-full"
        assert load_tensors(path)[0]["a"].shape == (100,)
        assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_a_full_disk_keeps_the_last_checkpoint(tmp_path):
    whole = Broad()
    run_loop(whole, RunFolder(tmp_path / "whole", {}), SETTINGS)
    run = RunFolder(tmp_path / "parts", {})
    with pytest.raises(KeyboardInterrupt):
        run_loop(Broad(die_at=6), run, SETTINGS)
    kept = (run.path / "checkpoint.safetensors").read_bytes()
    with (
        files_of_at_most(500_000),
        pytest.raises(
            StorageError, match=r"checkpoint\.safetensors cannot be written, as the disk is full"
        ) as told,
    ):
        run_loop(Broad(), run, SETTINGS)
    assert told.value.code == "disk-full"
    assert (run.path / "checkpoint.safetensors").read_bytes() == kept
    assert not [path for path in run.path.iterdir() if path.name.startswith(".")]
    second = Broad()
    run_loop(second, run, SETTINGS)
    assert torch.equal(second.weight, whole.weight) and second.calls == 20


@pytest.mark.parametrize(
    ("error", "said", "code"),
    [
        (
            torch.AcceleratorError("CUDA error: unspecified launch failure\nmore"),
            "failure",
            "gpu-failed",
        ),
        (
            RuntimeError("CUDA error: device-side assert triggered"),
            "the GPU failed at step 6",
            "gpu-failed",
        ),
        (
            torch.OutOfMemoryError("CUDA out of memory."),
            "memory ran out at step 6",
            "gpu-memory",
        ),
    ],
)
def test_a_gpu_that_vanishes_is_one_sentence(tmp_path, error, said, code):
    class Vanishes(Walk):
        def step(self, index: int) -> dict[str, float]:
            if index == 6:
                raise error
            return super().step(index)

    run = RunFolder(tmp_path / "run", {})
    with pytest.raises(DeviceError, match=f"{said}.*goes on from step 4") as told:
        run_loop(Vanishes(), run, SETTINGS)
    assert "\n" not in str(told.value)
    whole, again = Walk(), Walk()
    run_loop(whole, RunFolder(tmp_path / "whole", {}), SETTINGS)
    run_loop(again, run, SETTINGS)
    assert torch.equal(again.weight, whole.weight)
    assert (told.value.code, told.value.values) == (code, {"step": 6})


def test_other_errors_of_a_step_are_as_they_are(tmp_path):
    class Wrong(Walk):
        def step(self, index: int) -> dict[str, float]:
            raise RuntimeError("shapes do not match")

    with pytest.raises(RuntimeError, match="shapes do not match"):
        run_loop(Wrong(), RunFolder(tmp_path, {}), SETTINGS)


def test_a_checkpoint_is_a_safetensors_file_of_all_types(tmp_path):
    tensors = {
        f"{kind}".replace(".", "_"): torch.arange(-3, 9).view(3, 4).T.to(kind) for kind in DTYPES
    } | {"none": torch.zeros(0, 3), "one": torch.tensor(7)}
    save_tensors(tmp_path / "a.safetensors", tensors, {"step": 3})
    loaded, state = load_tensors(tmp_path / "a.safetensors")
    assert state == {"step": 3}
    assert loaded.keys() == tensors.keys()
    assert all(loaded[n].dtype == t.dtype and torch.equal(loaded[n], t) for n, t in tensors.items())
    (tmp_path / "b.safetensors").write_bytes(save({n: t.contiguous() for n, t in tensors.items()}))
    with safe_open(tmp_path / "b.safetensors", "pt") as theirs:
        assert all(torch.equal(theirs.get_tensor(n), loaded[n]) for n in theirs.keys())  # noqa: SIM118
    whole = (tmp_path / "a.safetensors").stat().st_size
    assert size_of_tensors(tensors) < whole < size_of_tensors(tensors) + 2000


def test_memory_holds_no_copy_of_a_checkpoint(tmp_path):
    tensors = {f"t{i}": torch.ones(250_000) for i in range(8)}  # 1 MB each
    tracemalloc.start()
    save_tensors(tmp_path / "a.safetensors", tensors, {})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000
