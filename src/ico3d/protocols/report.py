"""A report: tables and pictures as Markdown, and the same figures as JSON."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from ico3d.common.files import write_atomic
from ico3d.errors import printable

MARKDOWN, FIGURES = "report.md", "report.json"
"""Names of the files of a report."""
NOT_MEASURED = "–"

Value = float | int | str | None
"""What stands in a cell; None where it was not measured."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        key: Key of its values in the rows.
        label: Heading.
        digits: Digits behind the point.
        better: Which values are better; the best one is set in bold type.
    """

    key: str
    label: str
    digits: int = 2
    better: Literal["more", "less", "neither"] = "neither"

    @property
    def heading(self) -> str:
        """The label, with an arrow to the better values."""
        return self.label + {"more": " ↑", "less": " ↓", "neither": ""}[self.better]


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        columns: All columns but the first, which holds the rows' names.
        rows: Values by key; `name` is the row's name.
        head: Heading of the first column.
    """

    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Value]]
    head: str = ""

    def markdown(self) -> str:
        """The table in Markdown; columns of which no row has a value are left out."""
        shown = [c for c in self.columns if any(row.get(c.key) is not None for row in self.rows)]
        lines = [
            " | ".join(["", self.head, *(column.heading for column in shown), ""]),
            "|" + "---|" * (len(shown) + 1),
        ]
        best = {column.key: self._best(column) for column in shown}
        for row in self.rows:
            cells = [_cell(row.get(c.key), c.digits, best[c.key]) for c in shown]
            lines.append(" | ".join(["", str(row["name"]), *cells, ""]))
        return "\n".join(line.strip() for line in lines)

    def absent(self) -> list[str]:
        """Labels of columns of which no row has a value."""
        missing = (c for c in self.columns if all(row.get(c.key) is None for row in self.rows))
        return [column.label for column in missing]

    def _best(self, column: Column) -> float | None:
        """The best of at least two values of a column."""
        values = [row.get(column.key) for row in self.rows]
        numbers = [value for value in values if isinstance(value, float | int)]
        if column.better == "neither" or len(numbers) < 2:
            return None
        return max(numbers) if column.better == "more" else min(numbers)


def _cell(value: Value, digits: int, best: float | None) -> str:
    if value is None:
        return NOT_MEASURED
    if isinstance(value, str):
        return value
    shown = f"{value:,.{digits}f}"
    return f"**{shown}**" if best is not None and value == best else shown


@dataclass(frozen=True)
class Picture:
    """A picture of a report.

    Attributes:
        file: Its path relative to the report.
        caption: What it shows.
    """

    file: str
    caption: str


@dataclass(frozen=True)
class Section:
    """A part of a report.

    Attributes:
        title: Heading.
        text: Sentences that say what was measured, and how.
        table: The figures, or None.
        pictures: Plots and strips.
    """

    title: str
    text: str = ""
    table: Table | None = None
    pictures: Sequence[Picture] = ()

    def markdown(self, level: int, place: str = "") -> str:
        """The section with a heading of a level; `place` stands before the files' names."""
        parts = [f"{'#' * level} {self.title}", self.text]
        if self.table is not None:
            parts.append(self.table.markdown())
            if absent := self.table.absent():
                parts.append(f"Not measured here: {'; '.join(absent)}.")
        parts += [f"![{p.caption}]({place}{p.file})\n\n*{p.caption}*" for p in self.pictures]
        return "\n\n".join(part for part in parts if part)


@dataclass(frozen=True)
class Report:
    """What a protocol measured.

    Attributes:
        title: Heading.
        facts: What must be known to repeat the measurement: settings, seeds, version, device.
        sections: Tables, plots and pictures.
        figures: All figures, for programs.
    """

    title: str
    facts: Mapping[str, object]
    sections: Sequence[Section]
    figures: Mapping[str, object] = field(default_factory=dict)

    def markdown(self, level: int = 1, place: str = "") -> str:
        """The report with a heading of a level; `place` stands before the names of its files."""
        head = f"{'#' * level} {self.title}"
        plain = {k: v for k, v in self.facts.items() if not isinstance(v, dict | list)}
        facts = "\n".join(f"- {name}: {value}" for name, value in plain.items())
        text = "\n\n".join([head, facts, *(s.markdown(level + 1, place) for s in self.sections)])
        return "\n".join(map(printable, text.splitlines()))

    def write(self, folder: Path) -> None:
        """Writes `report.md`, and all figures and facts as `report.json`, into a folder."""
        content = {"title": self.title, "facts": self.facts, "figures": self.figures}
        write_atomic(folder / FIGURES, json.dumps(content, indent=1, default=str).encode())
        write_atomic(folder / MARKDOWN, (self.markdown() + "\n").encode())
