"""Who an avatar is: name, knowledge and manner, from a bundle or a file (docs/conversation.md)."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from ico3d.bundle.limits import MAX_MANIFEST_BYTES, MAX_NOTES
from ico3d.common.people.spelling import spelled
from ico3d.common.typed import Rules, fill, parse_json, parse_toml, plain
from ico3d.errors import BundleError

LANGUAGE = re.compile(
    r"[a-z]{2,3}(-[A-Za-z]{3}){0,3}(-[A-Za-z]{4})?(-([A-Za-z]{2}|[0-9]{3}))?(-([A-Za-z0-9]{5,8}|[0-9][A-Za-z0-9]{3}))*"
)
VOICE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*(\+[A-Za-z0-9_-]+)?")
MOST_LETTERS = 4000  # of a text
MOST_IN_ALL = 500_000  # letters of all texts, more than people write by hand
MOST_NAMES, LONGEST_NAME = 1000, 100  # of forbidden topics, and letters of a name
MOST_ENTRIES = 100  # of a list that is no list of notes
MOST_SUGGESTIONS, LONGEST_SUGGESTION = 12, 100  # questions that are proposed, and letters of one
SUGGESTED_NOTES = 3  # that are proposed where the persona says nothing else


@dataclass(frozen=True)
class Persona:
    """Who the avatar is, what it knows and how it talks.

    Attributes:
        name: Name by which the avatar introduces itself.
        greeting: The avatar's first words.
        notes: What the avatar knows. A note is "question | question => answer", or a fact as a
            plain sentence, which only language models can use.
        manner: How the avatar behaves and talks, in a sentence or two.
        languages: Codes such as `en` or `pt-BR` of the languages in which the avatar answers, its
            own language first; empty for any language.
        voice: Name of the avatar's voice for each provider of voices, such as {"espeak-ng":
            "en+f2"}.
        forbidden: Topics about which the avatar declines to talk, each "word | other word".
        suggestions: Questions that are proposed to visitors; by default those of the first notes.
    """

    name: str
    greeting: str = ""
    notes: tuple[str, ...] = ()
    manner: str = ""
    languages: tuple[str, ...] = ()
    voice: dict[str, str] = field(default_factory=dict[str, str])
    forbidden: tuple[str, ...] = ()
    suggestions: tuple[str, ...] = ()

    @property
    def proposed(self) -> tuple[str, ...]:
        """The questions that are proposed to visitors."""
        asked = [wordings[0] for wordings in map(wordings_of, self.notes) if wordings]
        return self.suggestions or tuple(asked[:SUGGESTED_NOTES])


def wordings_of(note: str) -> tuple[str, ...]:
    """The wordings of the question that a note answers; none of a fact."""
    asked, arrow, _ = note.partition("=>")
    return tuple(one.strip() for one in asked.split("|") if one.strip()) if arrow else ()


REQUIRED = ("name", "greeting", "notes")
"""Entries that a bundle must have.

The other entries are newer; they are written only where they differ from their default.
"""


def without_defaults(persona: Persona) -> dict[str, Any]:
    """A persona as a bundle stores it, readable for older programs that know only `REQUIRED`."""
    values, empty = plain(persona), plain(Persona(""))
    return {key: v for key, v in values.items() if key in REQUIRED or v != empty[key]}


def with_defaults(value: Any, required: tuple[str, ...] = REQUIRED) -> Any:
    """Adds defaults for missing entries to parsed JSON or TOML of a persona.

    Args:
        value: The parsed data.
        required: Entries for which there is no default.
    """
    if not isinstance(value, dict):
        return value
    known = plain(Persona(""))
    given = cast(dict[str, Any], value)
    return {key: v for key, v in known.items() if key not in required} | given


def read_persona(path: Path) -> Persona:
    """Reads a persona's file, TOML or (by its suffix) JSON, in which only `name` is required.

    Raises:
        BundleError: If the file cannot be read or an entry is invalid.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_MANIFEST_BYTES + 1)
    except OSError as error:
        raise BundleError(f"{path}: cannot be read ({error.strerror}).") from error
    if len(data) > MAX_MANIFEST_BYTES:
        raise BundleError(f"{path}: is larger than {MAX_MANIFEST_BYTES} bytes.")
    value = (
        parse_json(data, str(path), BundleError)
        if path.suffix == ".json"
        else _parse_toml(data, path)
    )
    persona = fill(Persona, with_defaults(value, ("name",)), str(path), Rules(BundleError))
    check_persona(persona, str(path))
    _require(bool(persona.name.strip()), str(path), "name", "not be empty")
    for number, note in enumerate(persona.notes, 1):
        _check_note(note, number, path)
    return persona


def check_persona(persona: Persona, where: str) -> None:
    """Checks lengths and forms of all entries.

    Args:
        persona: The persona of a bundle or a file.
        where: Name of the bundle or file, for errors.

    Raises:
        BundleError: At the first invalid entry, which the sentence names.
    """
    _check_lengths(persona, where)
    short = _letters(persona.name) <= LONGEST_NAME  # a model reads it before each question
    _require(short, where, "name", f"have at most {LONGEST_NAME} letters")
    _require(len(persona.notes) <= MAX_NOTES, where, "notes", f"be at most {MAX_NOTES}")
    questions = sum(note.partition("=>")[0].count("|") + 1 for note in persona.notes)
    _require(questions <= MAX_NOTES, where, "notes", f"ask at most {MAX_NOTES} questions")
    few = len(persona.suggestions) <= MOST_SUGGESTIONS
    short = max([_letters(text) for text in persona.suggestions], default=0) <= LONGEST_SUGGESTION
    what = f"be at most {MOST_SUGGESTIONS} questions of at most {LONGEST_SUGGESTION} letters"
    _require(few and short, where, "suggestions", what)
    _require(all(map(str.strip, persona.suggestions)), where, "suggestions", "not be empty texts")
    for entry in ("languages", "voice", "forbidden"):
        few = len(getattr(persona, entry)) <= MOST_ENTRIES
        _require(few, where, entry, f"be at most {MOST_ENTRIES}")
    for code in persona.languages:
        known = LANGUAGE.fullmatch(code) is not None
        _require(known, where, "languages", f"be codes such as 'en' or 'pt-BR', not {code[:40]!r}")
    for name in persona.voice.values():  # engines look for files of these names
        known = VOICE.fullmatch(name) is not None
        _require(known, where, "voice", f"be names such as 'en+f2', not {name[:40]!r}")
    names = [name.strip() for topic in persona.forbidden for name in topic.split("|")]
    _require(all(names), where, "forbidden", "hold topics such as 'politics | elections'")
    few = len(names) <= MOST_NAMES and max(map(_letters, names), default=0) <= LONGEST_NAME
    what = f"hold at most {MOST_NAMES} names of at most {LONGEST_NAME} letters"
    _require(few, where, "forbidden", what)


def _check_lengths(persona: Persona, where: str) -> None:
    """Checks what visitors' questions are compared with, or a language model is told."""
    texts: dict[str, Iterable[str]] = {
        "name": (persona.name,),
        "greeting": (persona.greeting,),
        "notes": persona.notes,
        "manner": (persona.manner,),
        "languages": persona.languages,
        "voice": (*persona.voice, *persona.voice.values()),
        "forbidden": persona.forbidden,
        "suggestions": persona.suggestions,
    }
    total = 0
    for entry, given in texts.items():
        each = "" if entry in ("name", "greeting", "manner") else " each"
        for text in given:
            letters = len(text) if len(text) > MOST_LETTERS else _letters(text)
            short = letters <= MOST_LETTERS
            _require(short, where, entry, f"have at most {MOST_LETTERS} characters{each}")
            total += letters
    if total > MOST_IN_ALL:
        raise BundleError(f"{where}: persona has {total} letters; at most {MOST_IN_ALL} are read.")


def _letters(text: str) -> int:
    """How many letters a text has; one character may stand for eighteen."""
    return len(spelled("NFKC", text))


def _check_note(note: str, number: int, path: Path) -> None:
    questions, arrow, answer = note.partition("=>")
    asked = all(question.strip() for question in questions.split("|"))
    if not note.strip() or (arrow and not (answer.strip() and asked)):
        raise BundleError(
            f"{path}: note {number} is neither 'question | question => answer' nor a sentence."
        )


def _parse_toml(data: bytes, path: Path) -> dict[str, Any]:
    try:
        return parse_toml(data.decode())
    except ValueError as error:
        raise BundleError(f"{path}: is not valid TOML ({error}).") from error


def _require(holds: bool, where: str, entry: str, what: str) -> None:
    if not holds:
        raise BundleError(f"{where}: persona.{entry} must {what}.")
