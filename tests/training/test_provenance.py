"""What is written about how a model was made."""

import json
import subprocess

import pytest
import torch

from ico3d import __version__
from ico3d.errors import ModelError
from ico3d.training import provenance
from ico3d.training.provenance import ENVIRONMENTS, environment, environments, note_environment

CPU = torch.device("cpu")


def test_an_environment_names_what_computes():
    """Version, commit and device."""
    found = environment(CPU)
    assert (found["ico3d"], found["torch"]) == (__version__, torch.__version__)
    assert found["device"] == "cpu" and found["numba"]
    assert found["commit"] is None or len(found["commit"].removesuffix("-dirty")) == 40


def test_outside_of_a_checkout_there_is_no_commit(monkeypatch):
    """Neither where git is missing."""
    provenance._commit.cache_clear()

    def missing(*_, **__):
        raise FileNotFoundError("git")

    monkeypatch.setattr(subprocess, "run", missing)
    assert environment(CPU)["commit"] is None
    provenance._commit.cache_clear()


def test_a_run_that_goes_on_elsewhere_says_so(tmp_path, monkeypatch):
    """And one that goes on in the same place says that once."""
    note_environment(tmp_path, CPU)
    note_environment(tmp_path, CPU)
    assert environments([tmp_path]) == [environment(CPU)]
    monkeypatch.setattr(torch, "__version__", "99")
    note_environment(tmp_path, CPU)
    other = tmp_path / "other"
    note_environment(other, CPU)
    found = environments([tmp_path, other, tmp_path / "never begun"])
    assert [one["torch"] for one in found][1:] == ["99"] and len(found) == 2
    assert (tmp_path / ENVIRONMENTS).is_file()


@pytest.mark.parametrize("content", ["[" * 200_000, "{}", "[5]", "\0"])
def test_a_damaged_list_of_environments_is_one_sentence(tmp_path, content):
    (tmp_path / ENVIRONMENTS).write_text(content)
    with pytest.raises(ModelError, match=r"is damaged.*: remove it\."):
        environments([tmp_path])


def test_many_environments_take_time_by_their_number(tmp_path):
    many = [{"run": number} for number in range(50_000)]
    (tmp_path / ENVIRONMENTS).write_text(json.dumps([*many, many[0]]))
    assert environments([tmp_path, tmp_path]) == many  # by its square: half a minute
