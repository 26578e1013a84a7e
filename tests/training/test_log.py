"""What others read of a run's metrics."""

import shutil

import pytest

from ico3d.common.files import SPARE
from ico3d.errors import ModelError, StorageError
from ico3d.training import log as logs
from ico3d.training.log import METRICS, MetricsLog, latest_entry
from ico3d.training.run import RunFolder


def test_latest_entry(tmp_path):
    """The last whole line, while somebody is writing the next, however long the file is."""
    assert latest_entry(tmp_path) is None
    file = tmp_path / METRICS
    file.write_text("")
    assert latest_entry(tmp_path) is None
    file.write_text('{"step": 0, "loss"')
    assert latest_entry(tmp_path) is None
    lines = [f'{{"step": {step}, "loss": 0.5}}\n' for step in range(1_000)]
    file.write_text("".join(lines) + '{"step": 10')
    assert latest_entry(tmp_path) == {"step": 999, "loss": 0.5}


def test_what_is_kept_of_earlier_steps_leaves_room_and_follows_no_link(tmp_path, monkeypatch):
    lines = [f'{{"step": {step}, "loss": 0.5}}\n' for step in range(100)]
    theirs, file = tmp_path / "theirs.jsonl", tmp_path / "run" / METRICS
    theirs.write_text("".join(lines))
    file.parent.mkdir()
    file.symlink_to(theirs)
    MetricsLog(file.parent, 50).close()
    assert file.read_text() == "" and not file.is_symlink()
    file.write_text("".join(lines))
    MetricsLog(file.parent, 50).close()
    assert file.read_text() == "".join(lines[:50])
    monkeypatch.setattr(logs, "MOST_NOTES", 300)  # of a file without an end, the last entries
    MetricsLog(file.parent, 50).close()
    kept = file.read_text()
    assert 0 < len(kept) <= 300 and kept == "".join(lines[:50])[-len(kept) :]
    assert kept.startswith('{"step"')
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=SPARE + len(kept) - 1))
    with pytest.raises(StorageError, match=r"metrics\.jsonl cannot be written"):
        MetricsLog(file.parent, 50)
    assert file.read_text() == kept


@pytest.mark.parametrize("name", ["metrics.jsonl", "state.json", "checkpoint.safetensors"])
def test_folders_in_the_place_of_files_are_said(tmp_path, name):
    (tmp_path / name).mkdir()
    with pytest.raises(ModelError, match="is a folder in the place of a file"):
        RunFolder(tmp_path, {})


def test_a_file_in_the_place_of_the_board_is_said_and_strange_folders_stay(tmp_path):
    (tmp_path / ".a.0123456789abcdef").mkdir()
    RunFolder(tmp_path, {})
    assert (tmp_path / ".a.0123456789abcdef").is_dir()
    (tmp_path / "tensorboard").touch()
    with pytest.raises(ModelError, match="is a file in the place of a folder"):
        RunFolder(tmp_path, {})
