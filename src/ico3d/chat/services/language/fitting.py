"""Texts within the tokens that a language model in this process is given at once.

Nobody can stop a model while it reads, and what reading takes grows with each token. Letters tell
little of that: a rare one is four tokens.
"""

from collections.abc import Callable, Iterable, Sequence

LETTERS = 16
"""Letters of the longest usual token: further ones are cut before anything is counted."""

Read = Callable[[str], Sequence[int]]
"""Turns a text into tokens."""
Write = Callable[[Sequence[int]], str]
"""Turns tokens into a text."""


def cut(text: str, most: int, read: Read, write: Write) -> tuple[str, int]:
    """The beginning of a text that has at most so many tokens, and their number."""
    text = text[: LETTERS * most]
    tokens = read(text)
    if len(tokens) <= most:
        return text, len(tokens)
    return write(tokens[:most]), most


def fitting(texts: Iterable[tuple[str, int]], most: int, read: Read, write: Write) -> list[str]:
    """The first of some texts, each cut, as far as there are tokens for them all.

    Args:
        texts: Each text with the highest number of its tokens, the one that matters most first.
        most: Highest number of tokens of all of them.
        read: Turns a text into tokens.
        write: Turns tokens into a text.
    """
    found = []
    for text, longest in texts:
        text, count = cut(text, longest, read, write)
        if count > most:
            break
        most -= count
        found.append(text)
    return found
