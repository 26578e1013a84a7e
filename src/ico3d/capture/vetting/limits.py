"""Limits of a process that handles a file of anybody; those of the machine stay as they are."""

import math
import time
from pathlib import Path


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
