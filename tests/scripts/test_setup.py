"""`make install` brings gsplat where there is an NVIDIA GPU, and only there."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SETUP = Path(__file__).parents[2] / "scripts" / "setup.sh"


def _program(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


@pytest.mark.parametrize(
    ("smi", "nvcc", "cuda"),
    [
        (None, False, False),
        ("exit 9", False, False),
        ("exit 0", False, True),
        ("exit 0", True, True),
    ],
)
def test_extras(tmp_path, smi, nvcc, cuda):
    """A driver without a GPU has nvidia-smi, too; gsplat needs nvcc to compile itself."""
    (tmp_path / "scripts").mkdir()
    shutil.copy(SETUP, tmp_path / "scripts")
    log = tmp_path / "log"
    _program(tmp_path / ".venv" / "bin" / "python", f'echo "$@" >> {log}')
    programs = {"python3": "exit 0", "node": "exit 0", "npm": "exit 0", "chromium": "exit 0"}
    programs |= {name: "exit 0" for name in ("dpkg", "nvcc") if name != "nvcc" or nvcc}
    programs |= {"id": "echo 1000"} | ({"nvidia-smi": smi} if smi else {})
    for name, text in programs.items():
        _program(tmp_path / "bin" / name, text)
    for name in ("bash", "dirname", "touch", "sh"):
        (tmp_path / "bin" / name).symlink_to(shutil.which(name))
    done = subprocess.run(
        ["bash", str(tmp_path / "scripts" / "setup.sh"), "develop"],
        env={**os.environ, "PATH": str(tmp_path / "bin")},
        capture_output=True,
        text=True,
        check=True,
    )
    installed = log.read_text().splitlines()[-1]
    assert "-e .[train," in installed and installed.endswith(",cuda]") == cuda
    assert ("no nvcc" in done.stderr) == (cuda and not nvcc)
