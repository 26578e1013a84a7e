"""The loop: exact resume, files, and what happens when numbers break."""

import json

import pytest
import torch

from ico3d.errors import ModelError, SettingsError
from ico3d.training.checkpoint import load_tensors, save_tensors
from ico3d.training.finite import NotFiniteError, check_finite
from ico3d.training.log import MetricsLog
from ico3d.training.loop import LoopSettings, run_loop
from ico3d.training.run import RunFolder
from training.walk import Walk

SETTINGS = LoopSettings(steps=20, log_every=5, checkpoint_every=4)


def test_a_killed_run_resumes_to_the_same_weights_and_metrics(tmp_path):
    whole = Walk()
    run_loop(whole, RunFolder(tmp_path / "whole", {"seed": 0}), SETTINGS)
    with pytest.raises(KeyboardInterrupt):
        run_loop(Walk(die_at=14), RunFolder(tmp_path / "parts", {"seed": 0}), SETTINGS)
    second = Walk()
    run_loop(second, RunFolder(tmp_path / "parts", {"seed": 0}), SETTINGS)
    assert torch.equal(second.weight, whole.weight)
    assert second.calls == 20
    logs = [(tmp_path / name / "metrics.jsonl").read_text() for name in ("whole", "parts")]
    assert logs[0] == logs[1]
    steps = [json.loads(line)["step"] for line in logs[0].splitlines()]
    assert steps == [0, 5, 10, 15, 19]


def test_a_nan_gradient_is_named_before_it_is_taken_over(tmp_path):
    walk = Walk(break_at=6)
    with pytest.raises(
        ModelError, match=r"the gradient of 'weight' is not finite at step 6: .* from step 4\)"
    ) as told:
        run_loop(walk, RunFolder(tmp_path, {}), SETTINGS)
    assert told.value.code == "diverged"
    assert all(torch.isfinite(tensor).all() for tensor in walk.tensors().values())
    whole, mended = Walk(), Walk()
    run_loop(whole, RunFolder(tmp_path / "whole", {}), SETTINGS)
    run_loop(mended, RunFolder(tmp_path, {}), SETTINGS)  # from the checkpoint, which is good
    assert torch.equal(mended.weight, whole.weight)


def test_a_nan_that_reaches_no_loss_is_found_at_the_next_entry(tmp_path):
    class Hidden(Walk):
        def step(self, index: int) -> dict[str, float]:
            if index == 12:
                self.unseen[1] = torch.inf
            return super().step(index)

        def tensors(self) -> dict[str, torch.Tensor]:
            return super().tensors() | {"unseen": self.unseen}

        unseen = torch.zeros(2)

    settings = LoopSettings(steps=100, log_every=5, checkpoint_every=50)
    with pytest.raises(ModelError, match=r"'unseen' is not finite at step 15: .* from step 0\)"):
        run_loop(Hidden(), RunFolder(tmp_path, {}), settings)


def test_great_but_finite_values_are_let_pass():
    check_finite({"a": torch.tensor([3e38, 3e38]), "b": torch.tensor([-torch.inf]).nan_to_num()})
    with pytest.raises(NotFiniteError, match="'a' is not finite"):
        check_finite({"a": torch.tensor([torch.inf, -torch.inf])})


def test_a_folder_keeps_to_its_settings(tmp_path):
    RunFolder(tmp_path, {"seed": 0, "steps": 10})
    RunFolder(tmp_path, {"seed": 0, "steps": 10})
    with pytest.raises(SettingsError, match=r"another 'seed' \(0, not 1\)"):
        RunFolder(tmp_path, {"seed": 1, "steps": 10})


def test_a_setting_that_differs_is_named_as_its_option(tmp_path):
    job = {"seed": 0, "joining": {"pruning": True}, "settings": {"steps": 9, "loss": {"l1": 0.8}}}
    RunFolder(tmp_path, job)
    RunFolder(tmp_path, job)
    for name, change in {
        r"loss\.l1' \(0\.8, not 1": {"settings": {"steps": 9, "loss": {"l1": 1.0}}},
        r"steps' \(9, not 8": {"settings": {"steps": 8, "loss": {"l1": 0.8}}},
        r"joining\.pruning' \(True, not False": {"joining": {"pruning": False}},
    }.items():
        with pytest.raises(SettingsError, match=f"holds a run with another '{name}"):
            RunFolder(tmp_path, job | change)


def test_a_run_of_an_earlier_version_is_refused(tmp_path):
    """Its settings had other names: nobody knows whether they are the same."""
    RunFolder(tmp_path, {"seed": 0, "steps": 9, "l1_weight": 0.8})
    with pytest.raises(SettingsError, match="holds a run that an earlier version of ico3d began"):
        RunFolder(tmp_path, {"seed": 0, "settings": {"steps": 9, "loss": {"l1": 0.8}}})


def test_tensors_and_state_survive_a_file(tmp_path):
    tensors = {"a": torch.arange(6.0).view(2, 3).T, "b": torch.tensor(3)}
    save_tensors(tmp_path / "x.safetensors", tensors, {"step": 3})
    loaded, state = load_tensors(tmp_path / "x.safetensors")
    assert state == {"step": 3}
    assert all(torch.equal(loaded[name], tensors[name]) for name in tensors)


@pytest.mark.parametrize("content", [b"", b"garbage" * 10])
def test_a_damaged_file_is_one_sentence(tmp_path, content):
    (tmp_path / "x.safetensors").write_bytes(content)
    with pytest.raises(ModelError, match=r"x\.safetensors is damaged"):
        load_tensors(tmp_path / "x.safetensors")


def test_finishing_drops_the_checkpoint(tmp_path):
    run = RunFolder(tmp_path, {})
    run_loop(Walk(), run, SETTINGS)
    assert run.checkpoint() is not None
    run.finish({"seconds": 1.0})
    assert run.checkpoint() is None
    assert run.finished() == {"seconds": 1.0}


def test_a_run_killed_while_it_finished_loses_its_checkpoint_later(tmp_path):
    run = RunFolder(tmp_path, {})
    run_loop(Walk(), run, SETTINGS)
    checkpoint = (tmp_path / "checkpoint.safetensors").read_bytes()
    run.finish({"seconds": 1.0})
    (tmp_path / "checkpoint.safetensors").write_bytes(checkpoint)
    assert RunFolder(tmp_path, {}).checkpoint() is None


def test_metrics_of_a_torn_line_are_dropped(tmp_path):
    log = MetricsLog(tmp_path, 0)
    log.write(0, {"loss": 1.0})
    log.write(5, {"loss": 0.5})
    log.close()
    path = tmp_path / "metrics.jsonl"
    path.write_text(path.read_text() + '{"step": 6, "lo')
    MetricsLog(tmp_path, 7).close()
    assert [json.loads(line)["step"] for line in path.read_text().splitlines()] == [0, 5]
