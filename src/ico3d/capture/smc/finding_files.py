"""Which of the SMC files in a folder is meant."""

from collections.abc import Sequence
from pathlib import Path

from ico3d.errors import CaptureError


def smc_files(folder: Path) -> list[Path]:
    """SMC files in a folder, by name."""
    if not folder.is_dir():
        return []
    return sorted(p for p in folder.iterdir() if p.suffix == ".smc" and p.is_file())


def only_one(folder: Path, mains: Sequence[Path]) -> Path:
    """The one recording in a folder.

    Args:
        folder: Where they lie, for the error.
        mains: The file by which each recording there is known.

    Raises:
        CaptureError: If there is none, or there are several.
    """
    if len(mains) != 1:
        names = ", ".join(p.name for p in mains[:3]) + (", …" if mains[3:] else "")
        raise CaptureError(f"{folder} holds {len(mains)} recordings ({names}): name one of them.")
    return mains[0]
