"""Folders that appear once they are complete."""

import json
import os
import signal
import stat
import subprocess
import sys

import pytest

from ico3d.capture.writing.new_folder import UNFINISHED, is_unfinished, new_folder


@pytest.mark.parametrize(("umask", "mode"), [(0o077, 0o700), (0o022, 0o755)])
def test_who_may_read_a_folder_is_for_the_umask_to_say(tmp_path, umask, mode):
    before = os.umask(umask)
    try:
        with new_folder(tmp_path / "out") as work:
            assert work.name.startswith(".out.")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "out").stat().st_mode) == mode


def test_nothing_is_left_of_one_that_failed(tmp_path):
    with pytest.raises(ValueError, match="halfway"), new_folder(tmp_path / "out") as work:
        (work / "file").touch()
        raise ValueError("halfway")
    assert not list(tmp_path.iterdir())


def left_by_a_killed_process(out):
    """What is left of a folder whose maker was killed."""
    code = (
        "import os, signal, sys; from pathlib import Path\n"
        "from ico3d.capture.writing.new_folder import new_folder\n"
        "with new_folder(Path(sys.argv[1]), 'Ada', ['ada.mp4']) as work:\n"
        "    (work / '0.jpg').touch()\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code, str(out)])
    assert ended.returncode == -signal.SIGKILL
    (left,) = out.parent.glob(f".{out.name}.*")
    return left


def test_what_a_killed_process_leaves_says_of_whom_it_is_and_goes_with_the_next(tmp_path):
    left = left_by_a_killed_process(tmp_path / "out")
    assert is_unfinished(left.name) and (left / "0.jpg").exists()
    about = json.loads((left / UNFINISHED).read_text())
    assert about == {"likeness": "Ada", "sources": ["ada.mp4"]}
    others = tmp_path / ".out2.00000000", tmp_path / ".out.0000", tmp_path / ".out.0123456789abcdef"
    for other in others:
        other.mkdir()
    (tmp_path / ".out.11111111").symlink_to(others[0])
    with new_folder(tmp_path / "out"):
        assert not left.exists()
    assert not (tmp_path / "out" / UNFINISHED).exists()
    assert all(other.is_dir() for other in others) and (tmp_path / ".out.11111111").is_symlink()


def test_what_somebody_else_is_making_is_kept(tmp_path):
    with new_folder(tmp_path / "out") as first, new_folder(tmp_path / "out.2") as beside:
        with pytest.raises(ValueError, match="second"), new_folder(tmp_path / "out") as second:
            assert first.is_dir() and beside.is_dir() and second != first
            raise ValueError("second")
        assert first.is_dir()
    assert {path.name for path in tmp_path.iterdir()} == {"out", "out.2"}
