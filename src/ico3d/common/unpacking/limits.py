"""Limits of a process that handles a file of anybody; those of the machine stay as they are."""

import math
import time
from importlib.util import find_spec
from pathlib import Path

from ico3d.common.unpacking.memory import free_memory

LEAST_BYTES = 8 << 30
"""Memory that a process may take where less is free: 12 s of 1080p at `best` took 1.7 GB as its
training began, on two cores of a shared cloud machine (2026-11-27), and the system counts what is
asked for, used or not."""


def limit_seconds(seconds: float) -> None:
    """Has this process killed when it has taken so many more seconds of processor time.

    Nor does it leave an image of its memory then.
    """
    import resource

    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_CPU, math.ceil(time.process_time() + seconds))


def limit_addresses(bytes: int) -> None:
    """Has this process refused memory beyond so many bytes of addresses, all that it has by now."""
    import resource

    _limit(resource.RLIMIT_AS, bytes)


def limit_memory(bytes: int) -> None:
    """Has this process refused more than so many further bytes of memory that it can write to."""
    import resource

    _limit(resource.RLIMIT_DATA, taken("VmData") + bytes)


def limit_to_free_memory() -> None:
    """Has this process refused more memory than nine tenths of what is free now.

    So a file of anybody that takes too much ends what opens it, and nothing beside it. Nothing is
    limited where the system has no such limits.
    """
    if find_spec("resource") is not None:
        limit_memory(max(free_memory() * 9 // 10, LEAST_BYTES))


def taken(what: str) -> int:
    """Bytes that this process takes, by Linux's name for them; 0 where the system does not tell."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) << 10 for line in lines if line.startswith(f"{what}:")), 0)


def _limit(what: int, most: int) -> None:
    """Lowers a limit for good."""
    import resource

    hard = resource.getrlimit(what)[1]
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(what, (most, most))
