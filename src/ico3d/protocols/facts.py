"""What must be known to repeat a measurement."""

import os
import platform
import sys
from datetime import date

import torch

from ico3d.training.provenance import environment


def facts_of(device: torch.device, **more: object) -> dict[str, object]:
    """The command, versions, the device and the day.

    Args:
        device: Where pictures are computed.
        more: Further facts; underscores of their names become spaces.
    """
    threads = torch.get_num_threads()
    made = environment(device)
    commit = made.pop("commit")
    if commit is not None:
        made["ico3d"] = f"{made['ico3d']}, commit {commit}"
    return {
        "command": " ".join(["ico3d", *sys.argv[1:]]),
        **made,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, {threads} threads",
        "date": date.today().isoformat(),
        **{name.replace("_", " "): value for name, value in more.items()},
    }
