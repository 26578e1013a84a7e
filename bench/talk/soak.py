"""Does a server hold more and more while visitors come and go?

    python bench/talk/soak.py runs/soak.csv --minutes 120 --plot runs/soak.png

Visitors come, talk, interrupt, vanish amid an answer without a farewell, come back, or leave at
once. Every few seconds the server's memory, descriptors, tasks, sessions and connections become a
row of the table, which is there for whoever kills the run. At the end all have left: tasks and
descriptors must be as many as before the first visitor. With `--minutes 0` a table that is there is
judged and drawn again. The exit status is 1 if something rises.
"""

import asyncio
import csv
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from random import Random
from typing import Annotated, TextIO

import httpx
import tyro
from prometheus_client.parser import text_string_to_metric_families

from ico3d.chat.settings.conversation import ChatSettings
from ico3d.chat.wire.protocol import RESUME_SECONDS
from ico3d.cli import run_script
from ico3d.measure.talking.rising import COLUMNS, Row, draw, read_rows, verdict
from ico3d.measure.talking.scripted import Script
from ico3d.measure.talking.serving import Watched, watching
from ico3d.measure.talking.visits import come_and_go

SCRIPT = Script(answer="One of it. Two of it. Three of it.", seconds=1.5)
NAMES = (
    *("process_resident_memory_bytes", "process_open_fds", "ico3d_tasks", "ico3d_sessions"),
    *("ico3d_connections", "process_cpu_seconds_total"),
)
"""The figures, in the order of `Row`."""
LEAVING = 2 * RESUME_SECONDS + 60  # s after which nobody's place can be kept any more


@dataclass(frozen=True)
class Soak:
    """Has visitors come and go, and judges what the server holds.

    Attributes:
        table: File for the figures, one row after the other (CSV).
        minutes: How long visitors come; 0 judges the file that is there.
        visitors: How many at once.
        every: Seconds between two rows.
        bundle: The avatar to serve.
        offline: Whether persona notes and espeak-ng answer, instead of services with set delays.
        seed: Of the visitors' choices.
        plot: File for a picture of the figures.
    """

    table: Annotated[Path, tyro.conf.Positional]
    minutes: float = 120.0
    visitors: int = 3
    every: float = 5.0
    bundle: Path = Path("demo")
    offline: bool = False
    seed: int = 0
    plot: Path | None = None

    def run(self) -> None:
        """Runs, draws, and prints the verdict."""
        if self.minutes > 0:
            self._record()
        rows = read_rows(self.table)
        if self.plot is not None:
            draw(rows, self.plot)
        claims = verdict(rows)
        for claim, holds in claims.items():
            print(f"{'holds' if holds else 'BROKEN'}: {claim}")
        sys.exit(not all(claims.values()))

    def _record(self) -> None:
        # who vanished holds a place for a while, and nobody is to wait in the queue
        settings = ChatSettings(max_sessions=8 * self.visitors)
        script = None if self.offline else SCRIPT
        with watching(self.bundle, script, settings) as server, open_table(self.table) as table:
            came = asyncio.run(self._soak(server, table))
        print(f"{sum(came.values())} visits:", dict(came))

    async def _soak(self, server: Watched, table: TextIO) -> Counter[str]:
        came: Counter[str] = Counter()
        begun, rows = time.monotonic(), csv.writer(table)

        def going_on() -> bool:
            return time.monotonic() < begun + 60 * self.minutes

        def count(name: str) -> None:
            came[name] += 1
            if ":" in name:
                print(f"{time.monotonic() - begun:.0f} s: {name}", file=sys.stderr, flush=True)

        async def note() -> Row:
            row = await observed(server.figures, time.monotonic() - begun, came.total())
            rows.writerow(astuple(row))
            table.flush()
            return row

        row = await note()
        randoms = [Random(1000 * self.seed + n) for n in range(self.visitors)]
        tasks = [come_and_go(server.url, random, going_on, count) for random in randoms]
        visitors = asyncio.gather(*tasks)
        while not visitors.done():
            await asyncio.wait({visitors}, timeout=self.every)
            row = await note()
        while row.sessions and time.monotonic() < begun + 60 * self.minutes + LEAVING:
            await asyncio.sleep(self.every)
            row = await note()
        await asyncio.sleep(self.every)  # what the last session left is taken down
        await note()
        return came


@contextmanager
def open_table(path: Path) -> Iterator[TextIO]:
    """A new table with its head."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        csv.writer(file).writerow(COLUMNS)
        yield file


async def observed(figures: str, seconds: float, visits: int) -> Row:
    """What a server tells Prometheus now."""
    async with httpx.AsyncClient() as client:
        text = (await client.get(figures, timeout=30)).text
    families = text_string_to_metric_families(text)
    told = {sample.name: sample.value for family in families for sample in family.samples}
    return Row(seconds, visits, *(told[name] for name in NAMES))


if __name__ == "__main__":
    sys.exit(run_script(Soak))
