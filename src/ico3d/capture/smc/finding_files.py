"""Finds the SMC file of a recording in a folder."""

import os
from collections.abc import Sequence
from pathlib import Path

from ico3d.errors import CaptureError


def smc_files(folder: Path) -> list[Path]:
    """SMC files in a folder, sorted by name."""
    if not os.path.isdir(folder):
        return []
    return sorted(p for p in folder.iterdir() if p.suffix == ".smc" and os.path.isfile(p))


def only_one(folder: Path, mains: Sequence[Path]) -> Path:
    """The only recording in a folder.

    Args:
        folder: The folder, for errors.
        mains: Main file of each recording in the folder.

    Raises:
        CaptureError: If there is no recording, or more than one.
    """
    if len(mains) != 1:
        names = ", ".join(p.name for p in mains[:3]) + (", …" if mains[3:] else "")
        raise CaptureError(f"{folder} holds {len(mains)} recordings ({names}): name one of them.")
    return mains[0]
