"""What somebody records: the parts, and the texts that they read."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

Turn = Literal["left", "right", "up", "down"]
TURNS: tuple[Turn, ...] = ("left", "right", "up", "down")
"""Ways to turn the head, as the person who turns it says."""
CONSENT, UPLOAD = "consent", "upload"
"""The part in which the person agrees aloud, and a video that is brought instead of the others."""
TEXTS = Path(__file__).parents[1] / "data" / "reading.json"


@dataclass(frozen=True)
class Reading:
    """A text to read aloud.

    Attributes:
        text: As it is shown.
        spoken: As espeak-ng reads it: in Japanese by syllables, else the same.
    """

    text: str
    spoken: str


@dataclass(frozen=True)
class Script:
    """What is said in one language.

    Attributes:
        consent: What the person agrees to, with `{name}`.
        voice: What they agree to besides, if their voice may be cloned.
        aloud: What they say while they turn the head.
        sounds: The language's speech sounds, in espeak-ng's symbols.
        texts: Texts that have all of these.
        heard: For each text which of the sounds are in it.
    """

    consent: str
    voice: str
    aloud: str
    sounds: tuple[str, ...]
    texts: tuple[Reading, ...]
    heard: tuple[tuple[str, ...], ...]


@cache
def scripts() -> dict[str, Script]:
    """The scripts by language."""
    return {language: _script(about) for language, about in _read().items()}


def part_ids(language: str) -> tuple[str, ...]:
    """Names of all parts in the order in which they are recorded."""
    texts = (f"text-{number}" for number in range(1, len(scripts()[language].texts) + 1))
    return (CONSENT, *texts, *TURNS)


ALL_IDS = frozenset({UPLOAD, CONSENT, *TURNS, *(f"text-{number}" for number in range(1, 13))})
"""Every name that a part may have, in any language."""


def _read() -> dict[str, dict]:
    return json.loads(TEXTS.read_text("utf-8"))


def _script(about: dict) -> Script:
    texts = tuple(Reading(one["text"], one.get("spoken", one["text"])) for one in about["texts"])
    heard = tuple(tuple(one["sounds"]) for one in about["texts"])
    said = about["consent"], about["voice"], about["aloud"]
    return Script(*said, tuple(about["sounds"]), texts, heard)
