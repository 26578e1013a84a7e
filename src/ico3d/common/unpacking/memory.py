"""How much memory is there for what is read."""

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import psutil

VERSION_1 = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
VERSION_2 = ("memory.max", "memory.current", "inactive_file")
"""Files with the limit and the use of a control group, and what its statistics call files that were
read ahead."""
TORCH_LACKS = "can't allocate memory"
"""What torch says where memory runs out: its error is a RuntimeError."""


def free_memory() -> int:
    """Bytes that programs can still have: of the machine, or of the container they run in."""
    try:
        lines = Path("/proc/self/cgroup").read_text()
    except OSError:
        lines = ""
    groups = _groups(lines, Path("/sys/fs/cgroup"))
    free = [left for group in groups if (left := _free_in_group(*group)) is not None]
    return min(psutil.virtual_memory().available, *free)


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


def _groups(lines: str, root: Path) -> Iterator[tuple[Path, tuple[str, str, str]]]:
    """The folders of control groups that a process is in, and their parents', with file names.

    Args:
        lines: Contents of `/proc/self/cgroup`.
        root: Where control groups are mounted.
    """
    for line in lines.splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            top, files = root, VERSION_2
        elif "memory" in controllers.split(","):
            top, files = root / "memory", VERSION_1
        else:
            continue
        own = PurePosixPath(path).relative_to("/")
        yield from ((top / folder, files) for folder in (own, *own.parents))


def _free_in_group(group: Path, files: tuple[str, str, str] = VERSION_2) -> int | None:
    """Bytes below the limit of a control group; None where there is no limit.

    Files that the system has read ahead and can forget count as free.
    """
    limit, current, read_ahead = files
    try:
        most = (group / limit).read_text().strip()
        used = int((group / current).read_text())
        facts = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
    except (OSError, ValueError):
        return None
    if not most.isdigit():  # "max"
        return None
    return max(int(most) - used + int(facts.get(read_ahead, 0)), 0)
