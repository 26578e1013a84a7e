"""What must be known to repeat a measurement."""

import os
import platform
import subprocess
import sys
from datetime import date
from pathlib import Path

import torch

import ico3d
from ico3d.splat.device import device_name


def facts_of(device: torch.device, **more: object) -> dict[str, object]:
    """The command, versions, the device and the day.

    Args:
        device: Where pictures are computed.
        more: Further facts; underscores of their names become spaces.
    """
    threads = torch.get_num_threads()
    return {
        "command": " ".join(["ico3d", *sys.argv[1:]]),
        "ico3d": _version(),
        "torch": torch.__version__,
        "device": device_name(device),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, {threads} threads",
        "date": date.today().isoformat(),
        **{name.replace("_", " "): value for name, value in more.items()},
    }


def _version() -> str:
    """The version, with the commit where the code is a checkout of the repository."""
    folder = Path(ico3d.__file__).parent
    words = ["git", "-C", str(folder), "describe", "--always", "--dirty", "--exclude", "*"]
    try:
        told = subprocess.run(words, capture_output=True, text=True, timeout=10)
    except OSError:  # there is no git
        return ico3d.__version__
    commit = told.stdout.strip()
    return f"{ico3d.__version__}, commit {commit}" if commit else ico3d.__version__
