"""Where the port is taken, one command starts the demo on another one."""

import socket
import subprocess
from pathlib import Path

import pytest

from ico3d.chat.serving.server import bind
from ico3d.errors import SettingsError

REPOSITORY = Path(__file__).parents[2]


@pytest.mark.parametrize("target", ["demo", "demo-natural"])
def test_make_takes_a_port(target):
    command = ["make", "--dry-run", target, "PORT=8770"]
    said = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    assert any("ico3d demo" in line and "--port 8770" in line for line in said.stdout.splitlines())


def test_a_taken_port_is_told_with_what_chooses_another_one():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(SettingsError, match=r"--port \(make demo: PORT="):
            bind("127.0.0.1", taken.getsockname()[1])
