"""`docs/settings.md` says what the dataclasses of the settings say, and all of it."""

import dataclasses
import tomllib

import pytest

from ico3d.bundle.persona import Persona
from ico3d.chat import reference
from ico3d.chat.remote.limits import Limits
from ico3d.chat.services import TABLES
from ico3d.chat.settings.conversation import ChatSettings, filled
from ico3d.chat.settings.tools import Tool

TABLES_OF_THE_FILE = [type(f.default) for f in dataclasses.fields(ChatSettings)]
PARTS = [part for part in TABLES_OF_THE_FILE if dataclasses.is_dataclass(part)]
PROVIDERS = [provider.settings for table in TABLES.values() for provider in table.values()]
KINDS = list(dict.fromkeys([ChatSettings, *PARTS, *PROVIDERS, Tool, Persona, Limits]))


def test_the_page_is_up_to_date():
    assert reference.TARGET.read_text(encoding="utf-8") == reference.markdown(), (
        "run python -m ico3d.chat.reference"
    )


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: f"{kind.__module__}.{kind.__name__}")
def test_every_key_has_a_sentence(kind):
    notes = reference.notes(kind)
    assert list(notes) == [field.name for field in dataclasses.fields(kind)]
    assert all(note.endswith(".") for note in notes.values())


@pytest.mark.parametrize("kind", PROVIDERS, ids=lambda kind: kind.__module__)
def test_defaults_stand_there_as_a_file_may_say_them(kind):
    lines = [
        f"{field.name} = {reference.default(field).strip('`')}"
        for field in dataclasses.fields(kind)
        if field.default is not None  # which a file says by leaving it out
    ]
    assert filled(kind, tomllib.loads("\n".join(lines)), "page") == kind()


def test_every_table_and_provider_has_a_place():
    lines = reference.TARGET.read_text(encoding="utf-8").splitlines()
    for field in dataclasses.fields(ChatSettings):
        places = (f"## `[{field.name}]`", f"## `[[{field.name}]]`", f"| `{field.name}` |")
        assert any(line.startswith(places) for line in lines), field.name
    for kind, table in TABLES.items():
        assert all(f'### `[{kind}]` with `use = "{name}"`' in lines for name in table)
