"""Processes beside the server import what is installed, and nothing that lies where it started."""

import subprocess

from ico3d.recording.beside import start


def test_modules_of_the_folder_are_not_imported(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    (tmp_path / "planted.py").write_text("print('taken over')")
    told, _ = start("planted", [], subprocess.PIPE).communicate()
    assert b"No module named planted" in told
