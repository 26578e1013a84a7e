"""What the verb `ico3d studio` prints, as a process of its own."""

import stat
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("verb", ["studio", "serve"])
def test_the_first_thing_printed_is_the_address(verb, tmp_path):
    words = [str(tmp_path / "faces"), "--no-browser"] if verb == "studio" else ["demo"]
    server = subprocess.Popen(
        [sys.executable, "-m", "ico3d.cli", verb, *words, "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    assert server.stdout is not None
    try:
        first = server.stdout.readline()
    finally:
        server.kill()
        server.communicate()
    name = b"The studio" if verb == "studio" else b"Iris"
    assert first.startswith(name + b" is at http://127.0.0.1:")
    if verb == "studio":  # nobody else on the machine reads recordings
        assert stat.S_IMODE((tmp_path / "faces").stat().st_mode) == 0o700


def test_a_folder_is_served_by_one_studio(tmp_path):
    """Another one would go on with the same makings, and write what the first one deletes."""
    words = [sys.executable, "-m", "ico3d.cli", "studio", str(tmp_path), "--no-browser"]
    words += ["--port", "0"]
    first = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert first.stdout is not None
    try:
        assert first.stdout.readline().startswith(b"The studio is at ")
        second = subprocess.run(words, capture_output=True, timeout=120)
    finally:
        first.kill()
        first.communicate()
    said = f"{tmp_path} is served by another ico3d studio: use its page, or end it."
    assert second.returncode == 1 and said in " ".join(second.stderr.decode().split())
