"""Presets of settings, and how the command line selects one.

Modules with settings must not import torch: `--help` shows their defaults and should be fast.
"""

from collections.abc import Sequence
from typing import Literal, TypeVar

import tyro

PresetName = Literal["cpu", "paper"]
"""`cpu` is sized for two CPU cores; `paper` has the numbers of the papers, for a GPU."""

Choice = TypeVar("Choice")


def chosen(kind: type[Choice], words: Sequence[str]) -> Choice:
    """Parses the options that decide the defaults of all other options, such as the preset.

    Args:
        kind: A dataclass that has only these options.
        words: All arguments that follow the verb; options that `kind` does not have are ignored.

    Returns:
        An instance of `kind`.
    """
    return tyro.cli(kind, args=list(words), add_help=False, return_unknown_args=True)[0]
