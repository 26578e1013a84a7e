"""What fuzzing found, as lines, a table and files."""

import json
import tempfile
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console
from rich.table import Table

from fuzz.bounds import Outcome, input_of
from fuzz.reader import Bench, Reader

COLUMNS = ("reader", "inputs", "read", "refused", "findings", "ms each", "longest, s", "most, MiB")


def say(name: str, outcome: Outcome) -> None:
    """Prints what one reader's inputs found, the most frequent first."""
    print(f"{name}: {outcome.inputs} inputs, {sum(outcome.findings.values())} findings", flush=True)
    for finding, times in outcome.findings.most_common():
        print(f"  {times} × {finding} (input {outcome.first[finding]})", flush=True)


def keep(reader: Reader, seed: int, numbers: Iterable[int], folder: Path) -> None:
    """Writes inputs of a reader into a folder."""
    with tempfile.TemporaryDirectory() as work:
        bench = Bench(reader, Path(work))
        for number in numbers:
            for name, content in input_of(bench, reader, seed, number).items():
                file = folder / reader.name / str(number) / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)


def table(outcomes: dict[str, Outcome], file: Path | None) -> None:
    """Prints the figures of all readers, and writes them as JSON."""
    rows = [row(name, outcome) for name, outcome in outcomes.items()]
    shown = Table(*COLUMNS)
    for cells in rows:
        shown.add_row(*map(str, cells))
    Console(width=110).print(shown)
    if file is not None:
        file.write_text(json.dumps([dict(zip(COLUMNS, r, strict=True)) for r in rows], indent=1))


def row(name: str, outcome: Outcome) -> tuple[str | int | float, ...]:
    """The figures of a reader, in the order of `COLUMNS`."""
    found = sum(outcome.findings.values())
    return (
        name,
        outcome.inputs,
        outcome.inputs - outcome.refused - found,
        outcome.refused,
        found,
        round(1000 * outcome.seconds / max(outcome.inputs, 1), 2),
        round(outcome.longest, 2),
        round(outcome.most),
    )
