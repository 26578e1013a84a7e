"""How much memory is there for what is read."""

from pathlib import Path

import psutil

TORCH_LACKS = "can't allocate memory"
"""What torch says where memory runs out: its error is a RuntimeError."""


def free_memory() -> int:
    """Bytes that programs can still have: of the machine, or of the container they run in."""
    free = psutil.virtual_memory().available
    group = _free_in_group(_own_group())
    return free if group is None else min(free, group)


def ran_out(error: BaseException) -> bool:
    """Whether an error says that memory ran out, whichever library raises it."""
    return isinstance(error, MemoryError) or TORCH_LACKS in str(error)


def lacks_room(path: Path, times: int) -> str:
    """What is wrong with a file that takes too much memory; empty if it does not.

    A disk may hold it in a few bytes, as a hole.

    Args:
        path: The file.
        times: How many times its size reading it takes.

    Raises:
        OSError: If it is not there.
    """
    size, most = path.stat().st_size, free_memory() // times
    if size <= most:
        return ""
    return f"has {size / 2**30:.1f} GiB; the free memory is enough for {most / 2**30:.1f}"


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
