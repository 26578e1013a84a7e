"""Presets of settings, and how words of the command line choose one of them.

Settings modules need no torch: `--help` shows their defaults, and has to be quick.
"""

from collections.abc import Sequence
from typing import Literal, TypeVar

import tyro

PresetName = Literal["cpu", "paper"]
"""`cpu` is sized for two CPU cores; `paper` has the numbers of the papers, for a GPU."""

Choice = TypeVar("Choice")


def chosen(kind: type[Choice], words: Sequence[str]) -> Choice:
    """What words say about the options that decide the defaults of all others.

    Args:
        kind: A dataclass with these options alone.
        words: All words behind a verb; other options among them are passed over.
    """
    return tyro.cli(kind, args=list(words), add_help=False, return_unknown_args=True)[0]
