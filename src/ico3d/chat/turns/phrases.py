"""Phrases that are no turn of their own ("uh-huh"), and phrases that interrupt ("stop")."""

import json
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

TABLE = Path(__file__).parents[1] / "data" / "phrases.json"
"""File with the phrases of each language: backchannels of listeners, and commands."""


@dataclass(frozen=True)
class Phrases:
    """Phrases of one or several languages.

    Attributes:
        backchannels: Phrases that people say while they listen.
        commands: Phrases by which people silence somebody.
    """

    backchannels: frozenset[str]
    commands: frozenset[str]

    def are_backchannels(self, text: str) -> bool:
        """Whether a text consists only of backchannels; False for an empty text."""
        return covered(plain(text).split(), self.backchannels)

    def is_command(self, text: str) -> bool:
        """Whether a text begins with a command."""
        words = plain(text).split()
        ends = range(1, min(len(words), longest(self.commands)) + 1)
        return any(" ".join(words[:end]) in self.commands for end in ends)


@cache
def phrases() -> Phrases:
    """Phrases of all languages, because the visitor's language is not known."""
    table = json.loads(TABLE.read_text(encoding="utf-8")).values()
    kinds = ("backchannels", "commands")
    return Phrases(*(frozenset(p for entry in table for p in entry[kind]) for kind in kinds))


def covered(words: list[str], known: frozenset[str]) -> bool:
    """Whether a list of words can be divided into known phrases completely."""
    most, reached = longest(known), {0}
    for end in range(1, len(words) + 1):
        starts = range(max(0, end - most), end)
        if any(start in reached and " ".join(words[start:end]) in known for start in starts):
            reached.add(end)
    return bool(words) and len(words) in reached


@cache
def longest(known: frozenset[str]) -> int:
    """Number of words of the longest phrase."""
    return max((len(phrase.split()) for phrase in known), default=0)


def plain(text: str) -> str:
    """Normalises a text: lower case, letters and digits of any script, single spaces."""
    return " ".join(re.findall(r"\w+", text.casefold()))
