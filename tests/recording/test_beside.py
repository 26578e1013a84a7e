"""Processes beside the server import what is installed, and nothing that lies where it started."""

import subprocess

from ico3d.recording.beside import start, stop


def test_modules_of_the_folder_are_not_imported(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    (tmp_path / "planted.py").write_text("print('taken over')")
    told, _ = start("planted", [], subprocess.PIPE).communicate()
    assert b"No module named planted" in told


def test_who_reads_later_than_the_end_finds_the_end():
    """Another thread may end the process before its reader has begun to read."""
    process = start(
        "timeit", ["-n", "1", "-r", "1", "import time; time.sleep(60)"], subprocess.PIPE
    )
    stop(process)
    assert process.stdout is not None and process.poll() is not None
    with process.stdout as printed:
        assert printed.read() == b""
