"""Terminals obey nothing that stands in files, or in the names of files."""

import logging

from rich import control

from ico3d.errors import printable

TURNING = "\u200e\u200f\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
OBEYED = {*map(chr, range(32)), *map(chr, range(127, 160)), *TURNING} - {"\n", "\t"}
"""Control characters but for line ends and tabs, and those that turn the direction of reading."""


class _Printable(logging.Formatter):
    """What libraries and readers of files warn of, line by line."""

    def format(self, record: logging.LogRecord) -> str:
        """The record's text, with escapes in the place of what is obeyed."""
        return "\n".join(map(printable, super().format(record).splitlines()))


def guard_terminal() -> None:
    """From now on what rich and loggers print shows as escapes what a terminal would obey.

    rich's own colours and movements are no text, and stay.
    """
    shown = {ord(character): printable(character) for character in OBEYED}
    control._CONTROL_STRIP_TRANSLATE.update(shown)  # type: ignore (private)
    if logging.lastResort is not None:
        logging.lastResort.setFormatter(_Printable())
