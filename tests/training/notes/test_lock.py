"""A run belongs to one process at a time."""

import fcntl

import pytest

from ico3d.errors import SettingsError
from ico3d.training.notes import lock
from ico3d.training.notes.lock import is_locked, locked
from ico3d.training.run import RunFolder


@pytest.fixture
def others(tmp_path):
    """The settings of a run, locked as another process would, which can let go."""
    file = tmp_path / "settings.json"
    file.write_text("{}")
    with file.open() as opened:
        fcntl.flock(opened, fcntl.LOCK_EX)
        yield opened


def test_a_second_process_is_refused(tmp_path, others, monkeypatch):
    monkeypatch.setattr(lock, "PATIENCE", 0.0)
    (tmp_path / ".checkpoint.0123456789abcdef.safetensors").touch()  # the other one writes it
    with pytest.raises(SettingsError, match="is being trained just now, by another process"):
        RunFolder(tmp_path, {})
    assert len(list(tmp_path.iterdir())) == 2
    assert is_locked(tmp_path / "settings.json")


def test_a_process_that_is_about_to_end_is_waited_for(tmp_path, others, monkeypatch):
    waited = []
    monkeypatch.setattr(lock.time, "sleep", lambda _: (waited.append(1), others.close()))
    RunFolder(tmp_path, {})
    assert waited == [1]


def test_within_a_process_everybody_has_the_same_lock(tmp_path):
    first, second = RunFolder(tmp_path, {}), RunFolder(tmp_path, {})
    del first
    assert is_locked(tmp_path / "settings.json")
    del second
    assert not is_locked(tmp_path / "settings.json")


def test_a_finished_run_can_be_opened_by_all(tmp_path, others):
    (tmp_path / "finished.json").write_text("{}")
    assert RunFolder(tmp_path, {}).finished() == {}


def test_where_nothing_can_be_locked_nothing_is(tmp_path, monkeypatch):
    def unsupported(*_):
        raise OSError("no locks available")

    monkeypatch.setattr(lock.fcntl, "flock", unsupported)
    file = tmp_path / "settings.json"
    file.write_text("{}")
    held = locked(file)
    assert locked(file) is held and not is_locked(file) and not is_locked(tmp_path / "none")
