"""Small files in which a person's folder keeps what is known of them."""

from pathlib import Path
from typing import Any

from ico3d.common.files import read_small
from ico3d.common.typed import parse_json

MOST, MOST_VALUES = 16 << 10, 2_000
"""Bytes of such a file, and lists, objects and entries in it. A page asks for a dozen of them at
once, again and again, and each may be a stranger's, who gave somebody the folder."""


def noted(file: Path) -> dict[str, Any]:
    """What a file of JSON says.

    Raises:
        OSError: If it is not there, no regular file, or larger than `MOST`.
        ValueError: If it is no object of JSON, or has more than `MOST_VALUES`.
    """
    data = read_small(file, links=False, most=MOST)
    return parse_json(data, file.name, ValueError, MOST_VALUES)
