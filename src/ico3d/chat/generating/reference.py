"""Generates `docs/protocol.md`: tables of all messages, inserted into the prose of `protocol.md`.

Run `python -m ico3d.chat.generating` after each change of a message or of the prose. In the prose,
`$CLIENT`, `$SERVER` and `$PARTS` stand for tables, and other capitalised names for constants.
"""

from pathlib import Path
from string import Template
from typing import Any

from ico3d.chat.generating.vocabulary import Vocabulary
from ico3d.chat.serving import connection, limits, waiting
from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import tensors_of
from ico3d.chat.wire.marks import Length, Range
from ico3d.common.docstrings import about, notes
from ico3d.common.typed import Kind, field_types

TARGET = Path(__file__).parents[4] / "docs" / "protocol.md"
PROSE = Path(__file__).with_name("protocol.md")

HEAD = (
    "<!-- Written by `python -m ico3d.chat.generating` from src/ico3d/chat/wire/protocol.py and "
    "src/ico3d/chat/generating/protocol.md: edit those. -->\n"
)
TYPES = {int: "whole number", float: "number", str: "text", bool: "true or false"}
HUGE = 1e7  # bounds beyond it only keep out what no sane page sends


def markdown() -> str:
    """The contents of `docs/protocol.md`."""
    title, _, prose = PROSE.read_text(encoding="utf-8").partition("\n")
    return f"{title}\n\n{HEAD}{Template(prose).substitute(values())}"


def values() -> dict[str, Any]:
    """Replacements for the names in the prose."""
    constants = {
        name: f"{value:,}" if isinstance(value, int) else f"{value:g}"
        for module in (connection, limits, waiting, protocol)
        for name, value in vars(module).items()
        if name.isupper() and isinstance(value, int | float)
    }
    return constants | {
        "KIB_TEXT": protocol.MAX_TEXT_FRAME // 1024,
        "KIB_BINARY": protocol.MAX_BINARY_FRAME // 1024,
        "OVERTIME": f"{limits.AUDIO_RATE / protocol.MICROPHONE_RATE:g}",
        "CLIENT": table(protocol.CLIENT_MESSAGES),
        "SERVER": table(protocol.SERVER_MESSAGES),
        "PARTS": "\n".join(map(part, protocol.PARTS)),
    }


def table(messages: tuple[type, ...]) -> str:
    """A table with a row for each message."""
    return "\n".join(["| type | what it says | fields |", "|---|---|---|", *map(row, messages)])


def row(message: type) -> str:
    """The row of one message."""
    name = message.__name__.lower() + ("` (binary)" if tensors_of(message) else "`")
    told = about(message).replace(" (binary)", "")
    return f"| `{name} | {cell(told)} | {cell('<br>'.join(fields(message)))} |"


def part(kind: type) -> str:
    """The description of a dataclass that messages contain."""
    return "\n  - ".join([f"- **{kind.__name__}**: {about(kind)}", *fields(kind)])


def fields(kind: type) -> list[str]:
    """Name, type and meaning of each field of a message or of a part of one."""
    told = notes(kind)
    return [
        f"`{name}` ({WORDS.written(note)}): {told[name]}"
        for name, note in field_types(kind).items()
    ]


def array(kind: Kind) -> str:
    """The size of an array in words."""
    tensor = kind.marks[0]
    return f"{tensor.dims}-dimensional, at most {tensor.max_size:,} elements"


def bounds(marks: tuple[Any, ...]) -> str:
    """The limits of a value in words, unless they are too wide to matter."""
    for mark in marks:
        if isinstance(mark, Length):
            return f", {mark.low:,}–{mark.high:,}"
        if isinstance(mark, Range) and 0 < abs(mark.low) < HUGE:
            return f", ≥ {mark.low:g}"
    return ""


WORDS = Vocabulary(
    array=array,
    maybe=lambda words: f"{words}, or null",
    words=lambda words: " or ".join(f"`{word}`" for word in words),
    items=lambda words, kind: f"list{bounds(kind.marks)}, of {words}",
    fixed=lambda words: f"[{', '.join(words)}]",
    record=lambda words, kind: f"object{bounds(kind.marks)}, of {words}",
    part=lambda part: f"**{part.__name__}**",
    plain=lambda kind: TYPES[kind.bare] + bounds(kind.marks),
)
"""A type annotation in words, with its limits."""


def cell(text: str) -> str:
    """Text, escaped for a cell of a table."""
    return text.replace("|", "\\|")
