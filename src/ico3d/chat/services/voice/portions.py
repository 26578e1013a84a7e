"""Portions of a text that are spoken one after the other, so that no text keeps others waiting."""

import re
import unicodedata
from collections.abc import Iterator

MOST = 200
"""Letters of a portion, written out: the one letter `ﷺ` is read as eighteen."""


_SIGN, _NAMED = 3, 12
"""Letters for which a sign of Chinese counts, and one that is read by its name: a voice of another
language says of both what they are."""
_DIGIT = 8
"""Letters for which a digit counts: nine of them are a dozen words. So is a `w` beside another one,
which is three syllables each time."""
_SPELT = re.compile(r"\d|[wW](?=[wW])|(?<=[wW])[wW]")
_WORD = 64
_UNSPACED = r"\u0e00-\u0eff\u1000-\u109f\u1780-\u17ff\u2e80-\u9fff"
_ENDLESS = re.compile(rf"[^\s{_UNSPACED}]{{{_WORD}}}(?=[^\s{_UNSPACED}])")


def parted(text: str) -> str:
    """A text whose words have at most 64 letters and marks, about as many as German's longest.

    espeak-ng, which Piper and Kokoro ask for phonemes, too, writes beyond a buffer where a word has
    140 of them, such as `s'` again and again. Scripts that have no spaces are left as they are.
    """
    return _ENDLESS.sub(r"\g<0> ", text)


def portions(text: str) -> Iterator[str]:
    """Yields a text in portions of at most `MOST` letters, cut between words where there are some.

    Whoever speaks them one by one can be interrupted between them, and lets others speak. Most
    sentences are one portion.
    """
    begin, letters, space = 0, 0, 0  # of a portion; `space` is behind its last white space
    counts = _written(text)
    for at, (char, written) in enumerate(zip(text, counts, strict=True)):
        if letters + written > MOST and at > begin:
            end = space if space > begin else at
            yield text[begin:end]
            begin, letters = end, sum(counts[end:at])
        letters += written
        if char.isspace():
            space = at + 1
    if begin < len(text):
        yield text[begin:]


def _written(text: str) -> list[int]:
    """About how many letters are spoken of each: a sign is read as a syllable, or by its name."""
    counts = [_NAMED if _is_named(char) else _spelled(char) for char in text]
    for spelt in _SPELT.finditer(text):
        counts[spelt.start()] = _DIGIT
    return counts


def _spelled(char: str) -> int:
    length = len(unicodedata.normalize("NFKC", char))
    return length * (_SIGN if "\u2e80" <= char <= "\u9fff" else 1)


def _is_named(char: str) -> bool:
    """Whether it is a picture, a pattern or a symbol, such as an emoji, braille or `≤`."""
    return unicodedata.category(char) in ("So", "Sm", "Sc")
