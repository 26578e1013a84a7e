"""Generates `docs/settings.md` from the dataclasses of the settings.

Run `python -m ico3d.chat.reference` after each change of a setting.
"""

import dataclasses
import json
from pathlib import Path
from typing import Any

from ico3d.bundle.persona import Persona
from ico3d.chat.remote.limits import Limits
from ico3d.chat.services import TABLES
from ico3d.chat.services.provider import Provider
from ico3d.chat.settings.conversation import ChatSettings, Choice, described, entry_kind_of
from ico3d.common.docstrings import notes, summary

TARGET = Path(__file__).parents[3] / "docs" / "settings.md"

HEAD = """\
# Settings

<!-- Written by `python -m ico3d.chat.reference` from the dataclasses: edit those. -->

Every table and key of the file that `ico3d serve`, `demo`, `serve-module` and `bench chat` take \
as `--settings`, and of [the persona's file](#the-personas-file). TOML, or JSON if the name ends \
in `.json`. What is left out has its default; a key that is not listed here, or a value of \
another type, is refused in one sentence. What it all does: [the conversation](conversation.md).

A table with nothing but `use` may be a line before the first table: `voice = "kokoro"`.
"""

PERSONA = """\
## The persona's file

`ico3d serve BUNDLE --persona ada.toml`, or for good `ico3d bake … --persona ada.toml`: \
[more](conversation.md#persona).
"""

LIMITS = """\
## Limits of a module

In no file: words behind `ico3d serve-module`, [more](conversation/modules.md).
"""


def markdown() -> str:
    """The contents of `docs/settings.md`."""
    fields = dataclasses.fields(ChatSettings)
    blocks = [
        HEAD,
        "## Before the first table\n",
        table([row(field, notes(ChatSettings)) for field in fields if not is_table(field)]),
        *(section(field) for field in fields if is_table(field)),
        PERSONA,
        rows_of(Persona),
        LIMITS,
        rows_of(Limits, "--limits."),
    ]
    return "\n".join(blocks)


def is_table(field: dataclasses.Field) -> bool:
    """Whether a setting is a table of the settings file, or a list of tables."""
    return part_of(field) is not None


def part_of(field: dataclasses.Field) -> Any:
    """The dataclass of a setting that is a table; None for other settings."""
    return entry_kind_of(field.type) or (
        field.type if dataclasses.is_dataclass(field.type) else None
    )


def section(field: dataclasses.Field) -> str:
    """The text about one table of the settings file."""
    name = f"[[{field.name}]]" if entry_kind_of(field.type) else f"[{field.name}]"
    blocks = [f"## `{name}`\n", notes(ChatSettings)[field.name] + "\n"]
    kind = part_of(field)
    if kind is not Choice:
        return "\n".join([*blocks, rows_of(kind)])
    use, _ = dataclasses.fields(Choice)
    blocks.append(table([row(use, notes(Choice))]))
    return "\n".join([*blocks, *(chapter(field.name, *p) for p in TABLES[field.name].items())])


def chapter(kind: str, name: str, provider: Provider) -> str:
    """The keys of one provider."""
    heading = f'### `[{kind}]` with `use = "{name}"`\n'
    shown = f"Visitors see “{provider.title}”. "
    if not dataclasses.fields(provider.settings):
        return "\n".join([heading, f"{shown}It has no keys but `use`.\n"])
    about = f"{shown}{summary(provider.settings)}\n"
    return "\n".join([heading, about, rows_of(provider.settings)])


def rows_of(kind: type, before: str = "") -> str:
    """Rows for the fields of a dataclass; `before` precedes each key."""
    return table([row(field, notes(kind), before) for field in dataclasses.fields(kind)])


def table(rows: list[str]) -> str:
    """A table with a heading and these rows."""
    return "\n".join(["| key | type | default | what it is |", "|---|---|---|---|", *rows, ""])


def row(field: dataclasses.Field, sentences: dict[str, str], before: str = "") -> str:
    """The row of one key.

    Args:
        field: Field of the dataclass.
        sentences: Description of each field, by name.
        before: Text before the key.
    """
    sentence = sentences[field.name].replace("|", "\\|")
    shown = default(field).replace("|", "\\|")
    return f"| `{before}{field.name}` | {described(field.type)} | {shown} | {sentence} |"


def default(field: dataclasses.Field) -> str:
    """The default of a setting, written as in the file."""
    if field.default is None:
        return "not given"
    if field.default is not dataclasses.MISSING:
        return f"`{written(field.default)}`"
    if field.default_factory is not dataclasses.MISSING:
        return f"`{written(field.default_factory())}`"
    return "must be there"


def written(value: Any) -> str:
    """A value in TOML's notation; of tables only an empty one."""
    return json.dumps(value, ensure_ascii=False)


if __name__ == "__main__":
    TARGET.write_text(markdown(), encoding="utf-8")
    print(f"wrote {TARGET}")
