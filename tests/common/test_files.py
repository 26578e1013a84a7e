"""Files are whole or not there."""

import os
import shutil
import tracemalloc
from pathlib import Path

import pytest

from ico3d.common import files
from ico3d.common.files import (
    SPARE,
    holds,
    json_of,
    read_object,
    read_small,
    remove_folder,
    remove_unfinished,
    walk,
    write_atomic,
    write_one_of_many,
)
from ico3d.errors import StorageError
from support.strangers.nested import nested


def test_a_failing_writer_leaves_the_old_file_and_nothing_else(tmp_path):
    write_atomic(tmp_path / "a.json", b"old")

    def fails(path: Path) -> None:
        path.write_bytes(b"ne")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_atomic(tmp_path / "a.json", fails)
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    assert (tmp_path / "a.json").read_bytes() == b"old"


@pytest.mark.parametrize("name", ["model.safetensors", "finished", "a.b.json"])
def test_what_killed_writers_left_is_removed_and_nothing_else(tmp_path, name):
    others = {".hidden.json", ".a.0123.json", "a.0123456789abcdef.json"}
    for other in others:
        (tmp_path / other).touch()
    seen = []
    write_atomic(tmp_path / name, lambda path: seen.append(path.name) or path.touch())
    (tmp_path / seen[0]).touch()  # as a writer killed before the rename leaves it
    remove_unfinished(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {name, *others}


def test_of_anybodys_files_only_small_regular_ones_are_read(tmp_path, monkeypatch):
    file, link, pipe = tmp_path / "a.json", tmp_path / "b.json", tmp_path / "c.json"
    file.write_bytes(b"{}")
    link.symlink_to(file)
    os.mkfifo(pipe)
    assert read_small(file) == read_small(link) == read_small(file, links=False) == b"{}"
    (tmp_path / "d.json").symlink_to("/dev/zero")
    for refused in (pipe, tmp_path / "d.json", tmp_path / "none.json", tmp_path):
        with pytest.raises(OSError, match=r"."):
            read_small(refused)
    with pytest.raises(OSError, match="symbolic links"):
        read_small(link, links=False)
    monkeypatch.setattr(files, "MOST_NOTES", 1)
    with pytest.raises(OSError, match="no small file"):
        read_small(file)


def test_what_a_file_holds_is_compared_only_where_it_is_as_long(tmp_path, monkeypatch):
    file = tmp_path / "plan.json"
    assert not holds(file, b"") and not holds(tmp_path, b"")
    file.write_bytes(b"abc")
    assert holds(file, b"abc") and not holds(file, b"abd")
    with file.open("r+b") as hole:
        hole.truncate(1 << 33)
    monkeypatch.setattr(Path, "read_bytes", lambda _: pytest.fail("read"))
    assert not holds(file, b"abc")


def test_a_small_file_takes_little_memory_whatever_may_be_read(tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    tracemalloc.start()
    assert read_small(tmp_path / "a", most=files.MOST_BYTES) == b"abc"
    assert read_small(tmp_path / "a") == b"abc"
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()


def test_folders_are_walked_as_by_the_system_and_links_are_not(tmp_path):
    for name in ("b/c", "a"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "b" / "f").touch()
    (tmp_path / "a" / "up").symlink_to(tmp_path)
    (tmp_path / "b" / "round").symlink_to("round")
    found = [(str(place), sorted(inside), sorted(names)) for place, inside, names in walk(tmp_path)]
    expected = [
        (place, sorted(inside), sorted(names)) for place, inside, names in os.walk(tmp_path)
    ]
    assert sorted(found) == sorted(expected)


@pytest.mark.parametrize(
    "content", [b"[" * 200_000, b'{"a": ' * 200_000, b"\xff\xfe", b"", b"1" * 5000]
)
def test_what_is_no_json_is_told_as_such(tmp_path, content):
    file = tmp_path / "a.json"
    file.write_bytes(content)
    with pytest.raises(ValueError):
        json_of(file)
    assert read_object(file) == {}
    file.write_bytes(b'\xef\xbb\xbf{"a": [1, NaN]}')  # as some editors begin a file
    assert json_of(file)["a"][0] == 1


def test_one_of_many_files_leaves_room_on_the_disk(tmp_path, monkeypatch):
    path, left = tmp_path / "new" / "000001.png", [SPARE + 1, SPARE]
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=left.pop(0)))
    write_one_of_many(path, b"1")
    with pytest.raises(StorageError, match="cannot be written, as the disk is full"):
        write_one_of_many(path, b"2")
    assert path.read_bytes() == b"1"


@pytest.mark.parametrize("longest", [files.LONGEST, 300])  # beyond, folders are moved up
def test_a_folder_is_removed_however_deep_and_links_lead_nowhere(tmp_path, monkeypatch, longest):
    folder, kept = tmp_path / "gone", tmp_path / "kept"
    kept.mkdir()
    (kept / "file").touch()
    folder.mkdir()
    (folder / "link").symlink_to(kept)
    (folder / "round").symlink_to("round")
    os.mkfifo(folder / "pipe")
    with nested(folder):
        deepest = max((place for place, _, _ in walk(folder)), key=lambda place: len(place.parts))
        (deepest / "file").touch()
        deepest.chmod(0o500)
        monkeypatch.setattr(files, "LONGEST", longest)
        assert remove_folder(folder) is None
    assert [path.name for path in tmp_path.iterdir()] == ["kept"] and (kept / "file").exists()


def test_a_folder_that_may_not_be_written_is_moved_up(tmp_path, monkeypatch):
    """Only who may write in a folder may move it to another one, unless they are root."""
    folder = tmp_path / "gone"
    deep = folder / "d" / "e"
    deep.mkdir(parents=True)
    (deep / "file").touch()
    deep.chmod(0o555)
    rename = os.rename

    def strict(path, to):
        if not os.stat(path).st_mode & 0o200:
            raise PermissionError(13, "Permission denied", path)
        rename(path, to)

    monkeypatch.setattr(os, "rename", strict)
    monkeypatch.setattr(files, "LONGEST", len(os.fsencode(deep)))
    assert remove_folder(folder) is None and not folder.exists()


def test_what_is_left_of_a_folder_is_told(tmp_path, monkeypatch):
    folder = tmp_path / "folder"
    (folder / "a").mkdir(parents=True)
    (folder / "a" / "stays").touch()
    (folder / "goes").touch()
    unlink = os.unlink

    def refuse(path: str) -> None:
        if path.endswith("stays"):
            raise PermissionError(1, "Operation not permitted")
        unlink(path)

    monkeypatch.setattr(os, "unlink", refuse)
    fault = remove_folder(folder)
    assert fault is not None and fault.strerror == "Operation not permitted"
    assert [place.name for place, _, _ in walk(folder)] == ["folder", "a"]
    assert not (folder / "goes").exists()
