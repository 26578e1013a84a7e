"""Portions of a text that are spoken one after the other, so that no text keeps others waiting."""

import unicodedata
from collections.abc import Iterator

MOST = 200
"""Letters of a portion, written out: the one letter `ﷺ` is read as eighteen."""


def portions(text: str) -> Iterator[str]:
    """Yields a text in portions of at most `MOST` letters, cut between words where there are some.

    Whoever speaks them one by one can be interrupted between them, and lets others speak. Most
    sentences are one portion.
    """
    begin, letters, space = 0, 0, 0  # of a portion; `space` is behind its last white space
    for at, char in enumerate(text):
        written = len(unicodedata.normalize("NFKC", char))
        if letters + written > MOST and at > begin:
            end = space if space > begin else at
            yield text[begin:end]
            begin, letters = end, _written(text[end:at])
        letters += written
        if char.isspace():
            space = at + 1
    if begin < len(text):
        yield text[begin:]


def _written(text: str) -> int:
    return sum(len(unicodedata.normalize("NFKC", char)) for char in text)
