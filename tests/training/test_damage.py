"""Files that a disk has damaged: training goes on from what is whole, and nothing is removed."""

import json
import tracemalloc

import pytest
import torch

from ico3d.common.unpacking import memory
from ico3d.errors import ModelError
from ico3d.training.checkpoint import load_sealed, load_tensors, save_sealed, save_tensors
from ico3d.training.log import MetricsLog
from ico3d.training.loop import LoopSettings, run_loop
from ico3d.training.run import BEFORE, CHECKPOINT, RunFolder
from training.walk import Walk

SETTINGS = LoopSettings(steps=20, log_every=5, checkpoint_every=4)


@pytest.fixture
def died(tmp_path):
    """The folder of a run that died at step 14, with checkpoints of steps 12 and 8."""
    with pytest.raises(KeyboardInterrupt):
        run_loop(Walk(die_at=14), RunFolder(tmp_path / "run", {}), SETTINGS)
    return tmp_path / "run"


def whole() -> torch.Tensor:
    """What a run becomes that nothing happens to."""
    walk = Walk()
    for index in range(SETTINGS.steps):
        walk.step(index)
    return walk.weight


def flipped(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 16]) + data[at + 1 :]


def of_another_training(file):
    tensors, state = load_sealed(file)
    save_sealed(file, {f"other_{name}": tensor for name, tensor in tensors.items()}, state)


DAMAGES = {
    "empty": lambda file: file.write_bytes(b""),
    "cut": lambda file: file.write_bytes(file.read_bytes()[:-5]),
    "half": lambda file: file.write_bytes(file.read_bytes()[: file.stat().st_size // 2]),
    "a tensor": lambda file: file.write_bytes(flipped(file.read_bytes(), -3 % file.stat().st_size)),
    "the step": lambda file: file.write_bytes(file.read_bytes().replace(b"12, ", b"13, ")),
    "other names": of_another_training,
    "no state": lambda file: save_sealed(file, load_sealed(file)[0], {}),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_checkpoint_falls_back_to_the_one_before(died, caplog, damage):
    DAMAGES[damage](died / CHECKPOINT)
    walk = Walk()
    run_loop(walk, RunFolder(died, {}), SETTINGS)
    assert torch.equal(walk.weight, whole()) and walk.calls == 20
    (said,) = caplog.messages
    assert said.startswith(f"{died / CHECKPOINT} is ")
    assert said.endswith(" Training goes on from the checkpoint before, at step 8.")
    steps = [json.loads(line)["step"] for line in (died / "metrics.jsonl").read_text().splitlines()]
    assert steps == [0, 5, 10, 15, 19]


def test_a_flipped_bit_is_found_wherever_it_is(tmp_path):
    file = tmp_path / "a.safetensors"
    save_sealed(file, {"a": torch.arange(5.0), "b": torch.tensor(3)}, {"step": 3})
    good = file.read_bytes()
    for at in range(len(good)):
        file.write_bytes(flipped(good, at))
        with pytest.raises(ModelError, match=r"a\.safetensors is damaged"):
            load_sealed(file)
    file.write_bytes(good)
    assert load_sealed(file)[1] == {"step": 3}


def test_where_all_are_damaged_one_sentence_says_so_and_nothing_is_removed(died):
    (died / CHECKPOINT).write_bytes(b"")
    (died / BEFORE).write_bytes(b"garbage")
    before = {file.name: file.read_bytes() for file in died.glob("*.*")}
    with pytest.raises(
        ModelError, match=r"There is no other checkpoint .* to begin afresh"
    ) as told:
        run_loop(Walk(), RunFolder(died, {}), SETTINGS)
    assert "\n" not in str(told.value) and told.value.code == "checkpoint"
    assert {file.name: file.read_bytes() for file in died.glob("*.*")} == before


def test_a_damaged_checkpoint_never_takes_the_place_of_the_good_one(died):
    """Even if training dies again right after the next checkpoint, which is damaged, too."""
    (died / CHECKPOINT).write_bytes(b"")
    with pytest.raises(KeyboardInterrupt):
        run_loop(Walk(die_at=13), RunFolder(died, {}), SETTINGS)  # saves at 12, from 8
    (died / CHECKPOINT).write_bytes(b"")
    run = RunFolder(died, {})
    found = run.checkpoint()
    assert found is not None and found[1]["step"] == 8
    walk = Walk()
    run_loop(walk, run, SETTINGS)
    assert torch.equal(walk.weight, whole())


def test_a_kill_between_two_renames_leaves_the_one_before(died, caplog):
    (died / CHECKPOINT).rename(died / BEFORE)
    walk = Walk()
    run_loop(walk, RunFolder(died, {}), SETTINGS)
    assert torch.equal(walk.weight, whole()) and not caplog.messages


def test_checkpoints_of_earlier_versions_are_taken(died):
    """They have no hash."""
    save_tensors(died / CHECKPOINT, *load_sealed(died / CHECKPOINT))
    found = RunFolder(died, {}).checkpoint()
    assert found is not None and found[1]["step"] == 12


@pytest.mark.parametrize("name", ["settings.json", "finished.json"])
@pytest.mark.parametrize(
    "content", [b"", b'{"a', b"[]", b"\xff\x00", b"[" * 200_000], ids=lambda text: text[:4]
)
def test_other_damaged_files_of_a_run_are_one_sentence(died, name, content):
    (died / name).write_bytes(content)
    with pytest.raises(ModelError, match=rf"{name} is damaged: put a copy of it there"):
        RunFolder(died, {})
    assert (died / CHECKPOINT).is_file() and (died / BEFORE).is_file()


def test_damaged_metrics_stop_no_training(died):
    text = (died / "metrics.jsonl").read_bytes().splitlines(keepends=True)
    (died / "metrics.jsonl").write_bytes(
        text[0] + b"\0\0\xff\n[]\n" + b"[" * 200_000 + b"\n" + text[1]
    )
    run_loop(Walk(), RunFolder(died, {}), SETTINGS)
    steps = [json.loads(line)["step"] for line in (died / "metrics.jsonl").read_text().splitlines()]
    assert steps == [0, 5, 15, 19]


def test_metrics_without_an_end_of_a_line_are_not_kept_in_memory(died):
    text = (died / "metrics.jsonl").read_bytes().splitlines(keepends=True)
    with (died / "metrics.jsonl").open("wb") as file:
        file.write(text[0])
        file.truncate(file.tell() + (60 << 20))
        file.seek(0, 2)
        file.write(b"\n" + text[1])
    tracemalloc.start()
    MetricsLog(died, 15).close()
    assert tracemalloc.get_traced_memory()[1] < 32 << 20
    tracemalloc.stop()
    steps = [json.loads(line)["step"] for line in (died / "metrics.jsonl").read_text().splitlines()]
    assert steps == [0, 5]


def test_a_file_that_claims_more_than_the_memory_holds_is_refused(tmp_path, monkeypatch):
    file = tmp_path / "model.safetensors"
    save_tensors(file, {"means": torch.zeros(300)}, {})
    size = file.stat().st_size
    monkeypatch.setattr(memory, "free_memory", lambda: 4 * size)
    assert len(load_tensors(file)[0]["means"]) == 300
    monkeypatch.setattr(memory, "free_memory", lambda: 4 * size - 1)
    with pytest.raises(ModelError, match=r"has 0\.0 GiB; the free memory is enough for 0\.0\.$"):
        load_tensors(file)
