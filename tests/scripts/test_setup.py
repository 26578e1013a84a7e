"""`make install` brings gsplat only to an NVIDIA GPU, and installs by uv or else by pip."""

import shutil
import subprocess
from pathlib import Path

import pytest

SETUP = Path(__file__).parents[2] / "scripts" / "setup.sh"
CONFIGURED = r"""case "$*" in
*"config list") cat <<'END'
:env:.find-links='/wheels https://a.example/w'
global.cert='/ca.pem'
global.extra-index-url='\nfile:///one\nfile:///two'
global.find-links='/others'
global.index-url='https://nowhere.example'
install.index-url='https://a.example/simple'
END
;;
*"uv pip install"*) echo "$UV_DEFAULT_INDEX|$UV_INDEX|$UV_FIND_LINKS|$SSL_CERT_FILE" ;;
esac"""
"""A Python whose pip is told in several places where to look, and whose uv says where it does."""


def _program(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


@pytest.fixture
def setup(tmp_path):
    """Runs a copy of the script among programs that do nothing.

    `programs` are there, too; `python` is what the environment's Python does. Gives what the
    script said, and what it asked of Python.
    """

    def run(purpose: str, programs: dict[str, str], python: str = "exit 0"):
        (tmp_path / "scripts").mkdir()
        shutil.copy(SETUP, tmp_path / "scripts")
        log = tmp_path / "log"
        _program(tmp_path / ".venv" / "bin" / "python", f'echo "$@" >> {log}\n{python}')
        idle = dict.fromkeys(("python3", "node", "npm", "chromium", "dpkg"), "exit 0")
        for name, text in (idle | programs).items():
            _program(tmp_path / "bin" / name, text)
        for name in ("bash", "cat", "dirname", "sed", "sh", "touch"):
            (tmp_path / "bin" / name).symlink_to(shutil.which(name))
        done = subprocess.run(
            ["bash", str(tmp_path / "scripts" / "setup.sh"), purpose],
            env={"PATH": str(tmp_path / "bin")},
            capture_output=True,
            text=True,
            check=True,
        )
        return done, log.read_text().splitlines()

    return run


@pytest.mark.parametrize(
    ("smi", "nvcc", "cuda"),
    [
        (None, False, False),
        ("exit 9", False, False),
        ("exit 0", False, True),
        ("exit 0", True, True),
    ],
)
def test_extras(setup, smi, nvcc, cuda):
    """A driver without a GPU has nvidia-smi, too; gsplat needs nvcc to compile itself."""
    programs = {"id": "echo 1000"} | ({"nvidia-smi": smi} if smi else {})
    done, asked = setup("develop", programs | ({"nvcc": "exit 0"} if nvcc else {}))
    assert asked[-1].startswith("-m uv pip install") and "-e .[train," in asked[-1]
    assert asked[-1].endswith(",cuda]") == cuda
    assert ("no nvcc" in done.stderr) == (cuda and not nvcc)


def test_uv_looks_where_pip_is_told_to_look(setup):
    """Variables go before files; of these, what is said of installing before what is of all."""
    done, asked = setup("serve", {}, CONFIGURED)
    assert done.stdout.splitlines()[-1] == (
        "https://a.example/simple|file:///one file:///two|/wheels,https://a.example/w|/ca.pem"
    )
    assert asked[-1].startswith("-m uv pip install")


def test_pip_installs_where_uv_fails(setup):
    """Pip is on every machine, and says what is wrong where it cannot install either."""
    _, asked = setup("serve", {}, 'case "$*" in "-m uv"*) exit 2 ;; esac')
    by_uv, by_pip = asked[-2:]
    assert by_uv.startswith("-m uv pip install") and by_pip.startswith("-m pip ")
    ends = "-c constraints.txt -e .[chat,voice]"
    assert by_uv.endswith(ends) and by_pip.endswith(ends)
