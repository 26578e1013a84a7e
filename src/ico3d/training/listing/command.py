"""The verb `ico3d runs`."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from ico3d.common.files import resolved

if TYPE_CHECKING:
    from ico3d.training.listing.find_runs import Run

AGES = ((86_400, "d"), (3_600, "h"), (60, "min"))
SIZES = ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"))


@dataclass(frozen=True)
class Runs:
    """Lists trainings: how far they are, what became of them, by which command each goes on.

    Attributes:
        folder: The folder to look through, with all folders below it.
    """

    folder: tyro.conf.Positional[Path] = Path()

    def run(self) -> None:
        """Prints one line for each run, and what belongs to it below.

        Raises:
            SettingsError: If there is no such folder.
        """
        import time

        from rich.console import Console

        from ico3d.errors import SettingsError, printable
        from ico3d.training.listing.find_runs import find_runs

        if not os.path.isdir(self.folder):
            raise SettingsError(f"there is no folder at {self.folder}.")
        console = Console(highlight=False, soft_wrap=True, markup=False)
        runs = find_runs(self.folder)
        for run in runs:
            for line in lines(run, time.time()):
                console.print(printable(line))
        if not runs:
            console.print(f"no trainings in {resolved(self.folder)} or below.")


def lines(run: "Run", now: float) -> list[str]:
    """What is printed of a run.

    Args:
        run: The run.
        now: The time, as `time.time()` has it.
    """
    steps = "?" if run.steps is None else run.steps
    told = [
        f"{run.path}: {run.kind}, step {run.step} of {steps}, {run.state}, "
        f"{_age(now - run.changed)}, {_size(run.size)}"
    ]
    if run.reason:
        told.append(f"  {run.reason}")
    if run.command:
        told.append(f"  {run.command}")
    elif run.state not in ("finished", "running"):
        told.append("  A program began it: run that again.")
    return told


def _age(seconds: float) -> str:
    for length, unit in AGES:
        if seconds >= length:
            return f"{int(seconds / length)} {unit} ago"
    return "just now"


def _size(count: int) -> str:
    for size, unit in SIZES:
        if count >= size:
            return f"{count / size:.1f} {unit}"
    return f"{count} B"
