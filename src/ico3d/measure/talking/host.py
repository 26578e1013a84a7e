"""What a virtual machine's host takes of its processor time, for others."""

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
    """Time that was taken.

    Attributes:
        cores: How many cores the host kept from running, on average; None where it is not known.
    """

    cores: float | None = None

    def sentence(self) -> str:
        """The share of stolen time as a sentence."""
        if self.cores is None:
            return "Whether the machine was this process' own is not known."
        return f"The host kept {self.cores:.2f} of {os.cpu_count()} cores from running meanwhile."


@contextmanager
def watched() -> Iterator[Stolen]:
    """Measures what is taken while something runs: times are longer for it.

    Yields:
        Is filled in at the end.
    """
    found, since, before = Stolen(), time.monotonic(), stolen_seconds()
    yield found
    after = stolen_seconds()
    if before is not None and after is not None:
        found.cores = (after - before) / (time.monotonic() - since)


def stolen_seconds() -> float | None:
    """Seconds taken since the machine started, of all cores together; None where not known."""
    try:
        ticks = int(STAT.read_text().split("\n", 1)[0].split()[COLUMN])
        return ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return None  # not Linux, or it does not say
