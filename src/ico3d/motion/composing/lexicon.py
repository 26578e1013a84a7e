"""The lexicon: which words call for which gesture."""

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
    """Content of `motion/data/lexicon.json`.

    Attributes:
        gestures: Names of all gestures in the lexicon.
        words: The gesture of each word.
        phrases: Phrases, as tuples of words, with their gestures; the longest phrases first.
        light: Words that are not stressed, such as articles.
        requests: Texts by which a visitor asks for a gesture, with the gesture; longest first.
        asking: Texts with which requests begin, such as "can you".
        refusing: Texts that turn a request into none, such as "don't".
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
    """The lexicon of the package."""
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
    """The words of a text in lower case, without punctuation."""
    return re.findall(r"[\w']+", text.lower().replace("’", "'"))


def meanings(words: tuple[Word, ...]) -> dict[int, str]:
    """The gestures that words call for, by index of the word; for a phrase, of its last word."""
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


def called_for(text: str) -> list[str]:
    """The gestures that the words of a text call for, in their order."""
    found = meanings(tuple(Word(said, 0.0, 0.0) for said in text.split()))
    return [found[i] for i in sorted(found)]


def stressed(word: Word) -> bool:
    """Whether a word can be stressed, unlike the light words of the lexicon."""
    return not set(plain(word.text)) <= lexicon().light


def requested(text: str, names: Iterable[str] = ()) -> str | None:
    """The gesture that a visitor asks for: "can you wave at me?" asks for a wave.

    Args:
        text: What the visitor says.
        names: Gestures that the person can make; those that are not in the lexicon are asked for by
            their names.

    Returns:
        Name of the gesture; None if the visitor asks for none.
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
