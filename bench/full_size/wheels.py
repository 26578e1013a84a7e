"""Brings packages to a machine without network, from wheels that lie beside. Needs Python alone."""

import os
import subprocess
import sys
import tempfile
from argparse import ArgumentParser
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OWN = ("torch-", "numpy-", "triton-", "nvidia_")
"""How names of wheels begin that the machine brings itself, built for its GPU."""


def install(wheels: Path, target: Path) -> list[str]:
    """Installs the wheels of a folder into another, without asking any index.

    Args:
        wheels: Folder of the wheels.
        target: Folder for the packages.

    Returns:
        Names of the installed files; those of `OWN` are left out.

    Raises:
        CalledProcessError: If a wheel is not for this Python or machine.
    """
    files = sorted(path for path in wheels.glob("*.whl") if not path.name.startswith(OWN))
    if files:
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps"]
        subprocess.run([*pip, "--target", str(target), *map(str, files)], check=True)
    return [file.name for file in files]


def run_with_wheels(words: list[str]) -> int | None:
    """Runs a script again with the packages of `--wheels` on its path.

    Args:
        words: The script and its words, of which `--wheels DIR` is taken away.

    Returns:
        Its exit status; None where the words name no wheels and nothing was run.
    """
    parser = ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--wheels", type=Path)
    known, rest = parser.parse_known_args(words[1:])
    if known.wheels is None:
        return None
    with tempfile.TemporaryDirectory(prefix="ico3d-wheels-") as target:
        install(known.wheels, Path(target))
        before = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
        paths = [str(ROOT / "src"), target, *before]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        return subprocess.run([sys.executable, words[0], *rest], env=environment).returncode
