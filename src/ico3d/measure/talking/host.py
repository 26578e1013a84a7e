"""Measures the processor time that a virtual machine's host withholds (steal time)."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

STAT = Path("/proc/stat")
COLUMN = 8  # of the line of all cores: ticks in which one of them was to run and could not


@dataclass
class Stolen:
    """Steal time of a virtual machine.

    Attributes:
        cores: Mean number of cores that the host kept from running; None if unknown.
    """

    cores: float | None = None

    def sentence(self) -> str:
        """The steal time as a sentence for users."""
        if self.cores is None:
            return "Whether the machine was this process' own is not known."
        return f"The host kept {self.cores:.2f} of {os.cpu_count()} cores from running meanwhile."


@contextmanager
def watched() -> Iterator[Stolen]:
    """Measures steal time during the `with` block, by which other measured times are longer.

    Yields:
        The result, which is filled in at the end of the block.
    """
    found, since, before = Stolen(), time.monotonic(), stolen_seconds()
    yield found
    after = stolen_seconds()
    if before is not None and after is not None:
        found.cores = (after - before) / (time.monotonic() - since)


def stolen_seconds() -> float | None:
    """Steal time in seconds since the machine started, over all cores; None if unknown."""
    try:
        ticks = int(STAT.read_text().split("\n", 1)[0].split()[COLUMN])
        return ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return None  # not Linux, or it does not say
