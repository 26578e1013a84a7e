"""How much memory pictures may take."""

from pathlib import Path
from threading import Lock
from typing import Literal

import psutil

Gib = float | Literal["auto"]
"""A limit of memory in GiB; `auto` for a share of what is free."""

SHARE = 0.5
"""Part of the free memory that the pictures of one process take."""


class Budget:
    """Memory for pictures.

    With `auto`, it follows what is free: of several processes that fill their memory at the same
    time, each leaves a part to the others, and together they never take all of it.

    Attributes:
        used: Bytes that are taken.
    """

    def __init__(self, gib: Gib):
        """Sets the limit."""
        self._gib, self.used, self._turn = gib, 0, Lock()

    def left(self) -> int:
        """Bytes that may still be taken."""
        if self._gib == "auto":
            return int(SHARE * (free_memory() + self.used)) - self.used
        return int(self._gib * 2**30) - self.used

    def take(self, size: int) -> bool:
        """Takes `size` bytes if so many are left; whether it did."""
        with self._turn:
            fits = size <= self.left()
            self.used += size if fits else 0
        return fits


def free_memory() -> int:
    """Bytes that programs can still have: of the machine, or of the container they run in."""
    free = psutil.virtual_memory().available
    group = _free_in_group(_own_group())
    return free if group is None else min(free, group)


def _own_group() -> Path:
    """The folder of this process's control group, version 2."""
    try:
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        lines = []
    path = next((line.removeprefix("0::/") for line in lines if line.startswith("0::/")), "")
    return Path("/sys/fs/cgroup") / path


def _free_in_group(group: Path) -> int | None:
    """Bytes below the limit of a control group; None where there is no limit.

    Files that the system has read ahead and can forget count as free.
    """
    try:
        most = (group / "memory.max").read_text().strip()
        used = int((group / "memory.current").read_text())
        facts = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
    except (OSError, ValueError):
        return None
    if not most.isdigit():  # "max"
        return None
    return max(int(most) - used + int(facts.get("inactive_file", 0)), 0)
