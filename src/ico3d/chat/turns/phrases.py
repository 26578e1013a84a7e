"""Words that are no turn of their own ("uh-huh"), and words that end another's ("stop")."""

import json
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

TABLE = Path(__file__).parents[1] / "data" / "phrases.json"
"""By language: what people say while they listen, and what they say to be listened to."""


@dataclass(frozen=True)
class Phrases:
    """The table's phrases of some languages.

    Attributes:
        backchannels: What people say while they listen.
        commands: What they say to silence somebody.
    """

    backchannels: frozenset[str]
    commands: frozenset[str]

    def are_backchannels(self, text: str) -> bool:
        """Whether a text consists of such phrases alone, said once or more; not if it is empty."""
        return covered(plain(text).split(), self.backchannels)

    def is_command(self, text: str) -> bool:
        """Whether a text begins with a command."""
        words = plain(text).split()
        return any(" ".join(words[:n]) in self.commands for n in range(1, len(words) + 1))


@cache
def phrases() -> Phrases:
    """Those of all languages: nobody is told in which one the visitor speaks."""
    table = json.loads(TABLE.read_text(encoding="utf-8")).values()
    kinds = ("backchannels", "commands")
    return Phrases(*(frozenset(p for entry in table for p in entry[kind]) for kind in kinds))


def covered(words: list[str], known: frozenset[str]) -> bool:
    """Whether words can be cut into known phrases without a rest."""
    reached = {0}
    for end in range(1, len(words) + 1):
        if any(start in reached and " ".join(words[start:end]) in known for start in range(end)):
            reached.add(end)
    return bool(words) and len(words) in reached


def plain(text: str) -> str:
    """Lower case, letters and digits of any script, single spaces."""
    return " ".join(re.findall(r"\w+", text.casefold()))
