"""One spelling for texts that may be written in several ways in Unicode, and may be anybody's."""

import re
import unicodedata
from typing import Literal

_PIECE = re.compile(r"\s*\S{0,256}")
"""Blanks and a word, or a part of one that is longer than any word."""


def spelled(form: Literal["NFC", "NFKC"], text: str) -> str:
    """A text in a normal form of Unicode, in a time that grows with its length alone.

    Python sorts the accents of a letter in the square of their number. Here words are normalised by
    themselves, and endless ones in pieces.
    """
    return "".join(unicodedata.normalize(form, piece) for piece in _PIECE.findall(text))
