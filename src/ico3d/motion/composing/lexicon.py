"""Which words call for which gesture."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ico3d.motion.composing.accents import Word

_FILE = Path(__file__).parents[1] / "data" / "lexicon.json"


@dataclass(frozen=True)
class Lexicon:
    """What `motion/data/lexicon.json` holds.

    Attributes:
        gestures: Those that it knows.
        words: The gesture of a word.
        phrases: Gestures of several words, as tuples of them; the longest first.
        light: Words that bear no stress of their own.
        requests: The gesture of what a visitor may ask for, the longest first.
        asking: How requests begin.
        refusing: What makes them none.
    """

    gestures: frozenset[str]
    words: dict[str, str]
    phrases: tuple[tuple[tuple[str, ...], str], ...]
    light: frozenset[str]
    requests: tuple[tuple[str, str], ...]
    asking: tuple[str, ...]
    refusing: tuple[str, ...]


@cache
def lexicon() -> Lexicon:
    """The package's own."""
    content = json.loads(_FILE.read_text("utf-8"))
    words: dict[str, str] = {}
    phrases: list[tuple[tuple[str, ...], str]] = []
    for gesture, entry in content["gestures"].items():
        words |= dict.fromkeys(entry["words"], gesture)
        phrases += [(tuple(plain(text)), gesture) for text in entry.get("phrases", [])]
    requests = [(text, gesture) for gesture, texts in content["requests"].items() for text in texts]
    return Lexicon(
        frozenset(content["gestures"]) | frozenset(content["requests"]),
        words,
        tuple(sorted(phrases, key=lambda found: -len(found[0]))),
        frozenset(content["light"]),
        tuple(sorted(requests, key=lambda found: -len(found[0]))),
        tuple(content["asking"]),
        tuple(content["refusing"]),
    )


def plain(text: str) -> list[str]:
    """The words of a text in small letters, without punctuation."""
    return re.findall(r"[\w']+", text.lower().replace("’", "'"))


def meanings(words: tuple[Word, ...]) -> dict[int, str]:
    """Gestures by the index of the word that calls for them; of phrases, the last word."""
    known = lexicon()
    texts = [" ".join(plain(word.text)) for word in words]
    found = {i: known.words[text] for i, text in enumerate(texts) if text in known.words}
    for phrase, gesture in known.phrases:
        for first in range(len(texts) - len(phrase) + 1):
            if tuple(texts[first : first + len(phrase)]) == phrase:
                for i in range(first, first + len(phrase)):
                    found.pop(i, None)
                found[first + len(phrase) - 1] = gesture
    return found


def stressed(word: Word) -> bool:
    """Whether a word bears stress of its own: no article, no auxiliary."""
    return not set(plain(word.text)) <= lexicon().light


def requested(text: str, names: Iterable[str] = ()) -> str | None:
    """The gesture that a visitor asks for: "can you wave at me?" is a wave.

    Args:
        text: What the visitor says.
        names: Gestures that somebody can make; those that the lexicon does not know are asked for
            by their name.

    Returns:
        Its name; None where none is asked for.
    """
    known = lexicon()
    others = [name for name in names if name not in known.gestures]
    own = [(name.replace("_", " "), name) for name in others]
    said = f" {' '.join(plain(text))} "
    if any(f" {word} " in said for word in known.refusing):
        return None
    for phrase, gesture in (*known.requests, *own):
        at = said.find(f" {phrase} ")
        if at == 0 or (at > 0 and any(f" {ask} " in said[: at + 1] for ask in known.asking)):
            return gesture
    return None
