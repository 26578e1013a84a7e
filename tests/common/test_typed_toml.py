"""TOML and JSON of strangers: what parsers take minutes or gigabytes for is refused."""

import json
import time
import tomllib

import pytest

from ico3d.bundle.persona import read_persona
from ico3d.chat.settings.conversation import MOST_BYTES, read_settings
from ico3d.common.typed import loose_json, parse_json, parse_toml
from ico3d.errors import BundleError, SettingsError


@pytest.mark.parametrize("part", ["a", '"a b"', " a ", "'a'"])
def test_a_key_of_many_parts_is_refused_at_once(tmp_path, part):
    file, started = tmp_path / "strange.toml", time.monotonic()
    file.write_text(".".join([part] * 30_000) + " = 1")
    with pytest.raises(SettingsError, match="keys have too many parts"):
        read_settings(file)
    with pytest.raises(BundleError, match="keys have too many parts"):
        read_persona(file)
    assert time.monotonic() - started < 5


@pytest.mark.parametrize(
    "text",
    [
        ".".join(["a"] * 2500) + '."=".' + ".".join(["a"] * 2500) + " = 1",
        'x = {a = """\n""", a."=".' + ".".join(["a"] * 5000) + " = 1}",
        "\n".join(f"[x{i}.{'.'.join(['a'] * 99)}]" for i in range(2000)),
        f"[{'.'.join(['a'] * 2500)}]\n" + "".join(f"k{i} = 1\n" for i in range(2000)),
        f"['{'.' * 99}'.{'.'.join(['a'] * 900)}]\n" + "".join(f"k{i}.a = 1\n" for i in range(5000)),
        "".join(f"[k{i:x}{'.a' * 14}]\n" for i in range(8000)),
        "k=1\n" * 101_000,
    ],
    ids=[
        "a key that holds a sign",
        "behind a text of several lines",
        "many tables",
        "short keys in a table of many parts",
        "the same, quoted",
        "many short tables",
        "many lines",
    ],
)
def test_keys_of_many_parts_are_refused_however_they_are_written(text):
    with pytest.raises(ValueError, match="keys have too many parts"):
        parse_toml(text)


def test_a_note_of_many_sentences_is_none():
    note = "She likes tea. " * 2000
    assert parse_toml(f'notes = ["{note}"]') == {"notes": [note]}
    assert parse_toml("a.b.c = 1") == {"a": {"b": {"c": 1}}}


@pytest.mark.parametrize("sentences", [1, 10, 600])
def test_a_persona_of_64_kilobytes_of_prose_is_one(sentences):
    """In lines of one or ten sentences each, or of all of them."""
    line = "She has lived by the sea for as long as she can think, and swims ... every morning. "
    lines = ["".join([line] * sentences)] * (64_000 // len(line) // sentences)
    notes = ",\n".join(f'"{line}"' for line in lines)
    assert parse_toml(f"[about]\nnotes = [\n{notes},\n]\nage = 4") == {
        "about": {"notes": lines, "age": 4}
    }
    prose = "\n".join(lines)
    assert parse_toml(f'notes = """\n{prose}"""\n[a.b]\nc.d = 0.5')["notes"] == prose


def test_what_is_nested_too_deep_is_no_toml():
    with pytest.raises(ValueError, match="nested too deep"):
        parse_toml("a = " + "[" * 50_000)


def test_settings_without_an_end_are_not_read(tmp_path):
    file = tmp_path / "long.toml"
    file.write_bytes(b"#" * (MOST_BYTES + 1))
    with pytest.raises(SettingsError, match="is larger than 1048576 bytes"):
        read_settings(file)


@pytest.mark.parametrize("value", ["[]", '{"a":1}'])
@pytest.mark.parametrize("parse", [loose_json, lambda text: parse_json(text, "it", ValueError)])
def test_json_of_millions_of_values_is_not_parsed(monkeypatch, parse, value):
    """Parsed, a file of 62 MB took 2 GB."""
    monkeypatch.setattr(json, "loads", lambda *_, **__: pytest.fail("parsed"))
    with pytest.raises(ValueError, match="more than 4,000,000 values"):
        parse(("[" + 2_100_000 * (value + ",") + "0]").encode())


def test_toml_that_nobody_wrote_is_not_parsed(monkeypatch):
    """A list of gestures in a bundle, or beside a model, may be as long as its file."""
    monkeypatch.setattr(tomllib, "loads", lambda _: pytest.fail("parsed"))
    with pytest.raises(ValueError, match="more than 1,048,576 characters"):
        parse_toml("x = [" + "[]," * 350_000 + "]")
