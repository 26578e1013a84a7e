"""Does what a server holds rise while visitors come and go? Judged and drawn from a table."""

import csv
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ico3d.errors import SettingsError

WARM = 0.25  # share of a run that is not judged: caches fill, the memory's pools grow
PER_HOUR = {"megabytes": 10.0, "descriptors": 2.0, "tasks": 10.0}
"""How fast each may rise; a session that is never taken down is worth some 43 tasks."""
FEWEST = 20  # rows to be judged


@dataclass(frozen=True)
class Row:
    """What a server held at one moment.

    Attributes:
        seconds: Since the first visitor.
        visits: Visits that are over.
        resident: Memory in bytes.
        descriptors: Open files and sockets.
        tasks: Tasks of the event loop.
        sessions: Visitors, those included whose connection is lost.
        connections: Open connections.
        processor: Seconds of processor time since the start.
    """

    seconds: float
    visits: float
    resident: float
    descriptors: float
    tasks: float
    sessions: float
    connections: float
    processor: float

    @property
    def megabytes(self) -> float:
        """Memory in MB."""
        return self.resident / 1e6


COLUMNS = tuple(field.name for field in fields(Row))


def read_rows(path: Path) -> list[Row]:
    """The rows of a table; one that was cut by the end of a run is left out.

    Raises:
        SettingsError: If it has too few rows to be judged.
    """
    with path.open(newline="") as file:
        whole = [row for row in list(csv.reader(file))[1:] if len(row) == len(COLUMNS)]
    if len(whole) < FEWEST:
        raise SettingsError(f"{path}: {len(whole)} rows are too few, {FEWEST} are needed.")
    return [Row(*map(float, row)) for row in whole]


def warm(rows: list[Row]) -> list[Row]:
    """The rows that are judged: after the warm-up, and while there were visitors."""
    begins = WARM * rows[-1].seconds
    return [row for row in rows if row.seconds >= begins and row.sessions > 0]


def slope(rows: list[Row], name: str) -> float:
    """By how much a figure rises in an hour, apart from what sessions and connections need.

    The least squares of the figure over time, sessions and connections.
    """
    hours = np.array([row.seconds for row in rows]) / 3600
    people = np.array([[row.sessions, row.connections] for row in rows])  # (R, 2)
    values = np.array([getattr(row, name) for row in rows])
    known = np.column_stack([hours, people, np.ones(len(rows))])
    return float(np.linalg.lstsq(known, values, rcond=None)[0][0])


def verdict(rows: list[Row]) -> dict[str, bool]:
    """What must hold of a whole run, and whether it does."""
    judged, first, last = warm(rows), rows[0], rows[-1]
    claims: dict[str, bool] = {}
    for name, most in PER_HOUR.items():
        rise = slope(judged, name)
        claims[f"{name} rise by {rise:+.1f} per hour, at most {most:g}"] = rise <= most
    for name in ("descriptors", "tasks", "sessions"):
        before, after = (getattr(row, name) for row in (first, last))
        claims[f"{name}: {before:g} before the first visitor, {after:g} at the end"] = (
            after <= before
        )
    return claims


def draw(rows: list[Row], path: Path) -> None:
    """Draws the figures over time, one below the other."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = {
        "megabytes": "memory, MB",
        "descriptors": "descriptors",
        "tasks": "tasks",
        "sessions": "sessions",
    }
    figure = Figure(figsize=(7.0, 6.4), layout="constrained")
    minutes = [row.seconds / 60 for row in rows]
    axes = figure.subplots(len(names), sharex=True)
    for axis, (name, title) in zip(axes, names.items(), strict=True):
        axis.plot(minutes, [getattr(row, name) for row in rows], linewidth=0.8)
        axis.set_ylabel(title)
        axis.set_ylim(bottom=0)
        axis.axvspan(0, WARM * minutes[-1], color="0.92")
        axis.spines[["top", "right"]].set_visible(False)
    axes[-1].set_xlabel("minutes; grey: warm-up, not judged")
    FigureCanvasAgg(figure).print_figure(path, dpi=100)
