"""Files are whole or not there."""

from pathlib import Path

import pytest

from ico3d.common.files import remove_unfinished, write_atomic


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
