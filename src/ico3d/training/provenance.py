"""What made a model: version, machine, seed and the parts of the settings that took effect."""

import json
import os
import subprocess
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path

import torch

import ico3d
from ico3d.common.files import json_of, write_atomic
from ico3d.errors import ModelError
from ico3d.splat.device import device_name

ENVIRONMENTS = "environments.json"
"""File of a run folder that lists where the run was computed, in order."""


def environment(device: torch.device) -> dict[str, str | None]:
    """Versions and device of a training in this process; `commit` is None outside of a checkout."""
    backend = import_module("numba" if device.type == "cpu" else "gsplat")
    return {
        "ico3d": ico3d.__version__,
        "commit": _commit(),
        "torch": torch.__version__,
        backend.__name__: backend.__version__,
        "device": device_name(device),
    }


def note_environment(folder: Path, device: torch.device) -> None:
    """Adds this process's environment to those of a run, unless the run went on in the same one.

    An interrupted run may go on with another version, or on another device.
    """
    known, now = environments([folder]), environment(device)
    if not known or known[-1] != now:
        write_atomic(folder / ENVIRONMENTS, json.dumps([*known, now], indent=1).encode())


def environments(folders: Iterable[Path]) -> list[dict]:
    """The environments of some runs, each once, in the order of the folders."""
    found: dict[str, dict] = {}
    for file in (folder / ENVIRONMENTS for folder in folders):
        if os.path.isfile(file):
            found |= {json.dumps(one, sort_keys=True): one for one in _listed(file)}
    return list(found.values())


def _listed(file: Path) -> list[dict]:
    try:
        listed = json_of(file)
    except (OSError, ValueError) as error:
        raise ModelError(f"{file} is damaged ({error}): remove it.") from error
    if not isinstance(listed, list) or not all(isinstance(one, dict) for one in listed):
        raise ModelError(f"{file} is damaged: remove it.")
    return listed


def provenance(folders: Iterable[Path], seed: int, used: Mapping[str, object]) -> dict:
    """How a model was made, for its file.

    Args:
        folders: Folders of the runs that made it.
        seed: Seed of all random numbers.
        used: What took effect, by name, where that may differ from what the settings ask for.
    """
    return {"seed": seed, "used": dict(used), "environments": environments(folders)}


@cache
def _commit() -> str | None:
    """The commit of the checkout that ico3d runs from, with `-dirty` where files were changed."""
    root = Path(ico3d.__file__).parents[2]
    if not os.path.exists(root / ".git"):
        return None
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=40"]
    command += ["--exclude", "*"]  # tags would hide the commit
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None
