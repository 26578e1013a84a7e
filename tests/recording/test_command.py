"""What the verb `ico3d studio` prints, as a process of its own."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("verb", ["studio", "serve"])
def test_the_first_thing_printed_is_the_address(verb, tmp_path):
    words = [str(tmp_path), "--no-browser"] if verb == "studio" else ["demo"]
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
