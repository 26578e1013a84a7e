"""An assembly that meets a full disk, NaN and the loss of a worker: it goes on exactly."""

from dataclasses import replace
from functools import partial

import pytest
import torch

from ico3d.avatar.joining.assemble import assemble
from ico3d.body.training.picture_step import Learner
from ico3d.body.training.train_clip import train_window
from ico3d.body.workers.jobs import Lost, train_windows
from ico3d.errors import ModelError, StorageError
from ico3d.training.listing.find_runs import find_runs
from support.avatars.planted_person import planted_head
from support.avatars.tiny_joining import assembly_of
from support.full_disk import files_of_at_most
from support.settings import changed

pytestmark = pytest.mark.slow

FEW = {"steps_per_frame": 3, "warmup_steps": 3, "checkpoint_every": 4, "density.begin": 5}


class Died(Exception):
    """What ends a worker."""


class Dying:
    """A `Crew` of one worker after another in this process, the first of which dies at a step."""

    capacity = 1

    def __init__(self, capture, patch):
        self._capture, self._patch, self._task = capture, patch, None
        self.lost = 0

    def expect(self, windows):
        pass

    def start(self, task):
        self._task = task

    def ended(self, timeout):
        try:
            return [(self._task, train_window(self._task, self._capture))]
        except Died:
            self._patch.undo()
            self.lost += 1
            return [(self._task, Lost("died"))]

    def stop(self):
        pass


def at_step(patch, number: int, happens) -> None:
    """Lets something happen to the picture of a step."""
    example = Learner.example

    def changed_example(self, view, index):
        found = example(self, view, index)
        return happens(found) if index == number else found

    patch.setattr(Learner, "example", changed_example)


def poisoned(example):
    return replace(example, target=torch.full_like(example.target, torch.nan))


def dies(example):
    raise Died


def files(folder):
    return {
        str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.safetensors")
    }


def test_an_assembly_goes_on_after_a_full_disk_nan_and_a_lost_worker(
    person, tmp_path, monkeypatch, capsys
):
    (tmp_path / "head").mkdir()
    planted_head().save(tmp_path / "head")
    assembly = assembly_of(tmp_path / "head", match_colors=False)
    assembly = replace(assembly, body=changed(assembly.body, FEW))
    go_on = partial(assemble, person, tmp_path / "parts", assembly, lambda _: None)
    assemble(person, tmp_path / "whole", assembly, lambda _: None)
    with files_of_at_most(10_000), pytest.raises(StorageError, match=r"head/model.* is full"):
        go_on()
    for number in (2, 10):
        said = pytest.raises(ModelError, match=f"finite at step {number}: ")
        with monkeypatch.context() as patch, said:
            at_step(patch, number, poisoned)
            go_on()
        with files_of_at_most(100_000), pytest.raises(StorageError, match=r"checkpoint.* is full"):
            go_on()
    (run,) = find_runs(tmp_path / "parts")
    assert (run.kind, run.step, run.steps, run.state) == ("assemble", 8, 18, "interrupted")
    with monkeypatch.context() as patch:
        at_step(patch, 13, dies)
        crew = Dying(person, patch)
        go_on(partial(train_windows, crew=crew))
    assert crew.lost == 1
    assert "its worker died; another goes on from step 12." in capsys.readouterr().out
    assert files(tmp_path / "parts") == files(tmp_path / "whole")
