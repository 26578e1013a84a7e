"""Prints how well a skeleton was fitted."""

from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
from rich.console import Console

from ico3d.capture.posing.tracking import Fitted

MOST_LINES = 12
"""Most lines, each about one of several runs of frames of about the same length."""


def say(found: Fitted, written: Path) -> None:
    """Prints a line for each run of frames, frames that were interpolated, and the track's file.

    Args:
        found: The fitted track.
        written: File of the track.
    """
    show = Console(stderr=True).print
    fitted = found.track.fitted
    for first, last in runs(len(fitted)):
        part = slice(first, last + 1)
        count = int(fitted[part].sum())
        text = f"frames {first}-{last}: {count} of {last - first + 1} fitted"
        if np.isfinite(found.off[part]).any():
            text += f", landmarks {1e3 * np.nanmedian(found.off[part]):.0f} mm off"
        if np.isfinite(found.outside[part]).any():
            text += f", surface {1e3 * np.nanmedian(found.outside[part]):.0f} mm out of masks"
        show(text, highlight=False)
    lost = gaps(fitted)
    if lost:
        names = [f"{a}" if a == b else f"{a}-{b}" for a, b in lost]
        show(f"[yellow]warning:[/] frames {', '.join(names)} are interpolated.")
    about = "; ".join(filter(None, (found.track.source, found.track.licence)))
    show(f"skeleton: {about}", highlight=False, soft_wrap=True)
    show(f"{int(fitted.sum())} of {len(fitted)} frames fitted: {written}", soft_wrap=True)


def runs(count: int) -> list[tuple[int, int]]:
    """Divides `count` frames into up to `MOST_LINES` runs of about the same length.

    Returns:
        First and last frame of each run.
    """
    edges = np.linspace(0, count, min(count, MOST_LINES) + 1).round().astype(int)
    return [(a, b - 1) for a, b in pairwise(edges.tolist())]


def gaps(fitted: np.ndarray) -> list[tuple[int, int]]:
    """First and last frame of each run of frames that were not fitted, from `fitted` (F,) bool."""
    found, place = [], 0
    for good, group in groupby(fitted.tolist()):
        length = len(list(group))
        if not good:
            found.append((place, place + length - 1))
        place += length
    return found
