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
