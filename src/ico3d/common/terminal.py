"""Terminals obey nothing that stands in files, or in the names of files."""

import re
import sys
from typing import IO, Any

from rich import control

from ico3d.errors import printable

TURNING = "\u200e\u200f\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
_CODES = (*range(9), *range(11, 32), *range(127, 160), *range(0xD800, 0xE000))
OBEYED = {*map(chr, _CODES), *TURNING}
"""Control characters but for line ends and tabs, those that turn the direction of reading, and lone
surrogates, which may be written as the bytes of others."""
SHOWN = {ord(character): printable(character) for character in OBEYED}
_CODE = "(?:[0-4]|2[2-4]|[39][0-79])"
COLOUR = re.compile(f"(\x1b\\[(?:{_CODE}(?:;{_CODE})*)?m)")
"""What makes letters coloured, bold or underlined, as tyro prints it; none makes them invisible."""


class Guarded:
    """A stream that shows as escapes what a terminal would obey, but for colours.

    Attributes:
        rich_proxied_file: The stream below. rich looks for it, and writes there: of its texts
            `guard_terminal` takes care, and its own movements stay.
    """

    def __init__(self, stream: IO[str]):
        """Guards what is written to `stream`."""
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        """Writes a text; the number of its letters."""
        self.rich_proxied_file.write(_shown(text))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        """Writes texts one behind the other."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        """All else is the stream's."""
        return getattr(self.rich_proxied_file, name)


def guard_terminal() -> None:
    """From now on what is printed shows as escapes what a terminal would obey.

    That is so whoever prints: this program, loggers, Python where it shows an error, rich.
    """
    control._CONTROL_STRIP_TRANSLATE.update(SHOWN)  # type: ignore (private)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not None and not isinstance(stream, Guarded):
            setattr(sys, name, Guarded(stream))


def _shown(text: str) -> str:
    if text.isprintable() or OBEYED.isdisjoint(text):
        return text
    parts = COLOUR.split(text)  # colours are every second one
    parts[::2] = [part.translate(SHOWN) for part in parts[::2]]
    return "".join(parts)
