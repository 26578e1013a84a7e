"""The part of a contact sheet that shows what somebody did in a recording."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ico3d.motion.recorded.cut import REST, Cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

COLUMNS = 6
MOST = 20
"""Clips that are shown."""
ROW = 2.6
"""Inches that one takes."""
COLOUR = "tab:purple"
Named = Sequence[tuple[str, Cut]]


def height(clips: Named) -> float:
    """Inches that clips take."""
    return ROW * min(len(clips), MOST)


def draw_clips(place: "SubFigure", clips: Named, picture: Callable[[int], np.ndarray]) -> None:
    """Draws a row for each clip: how it begins, its stroke, and how it ends.

    Args:
        place: Where.
        clips: By their names.
        picture: The person (H, W, 3) at a frame.
    """
    shown = clips[:MOST]
    rows = place.subplots(len(shown), COLUMNS, squeeze=False)
    for axes in rows.ravel():
        axes.set(xticks=(), yticks=())
        axes.axis("off")
    for row, (name, cut) in zip(rows, shown, strict=True):
        for axes, frame in zip(row, frames_of(cut), strict=False):
            axes.imshow(picture(frame))
            axes.set_title(_title(name, cut, frame), fontsize=9, color=COLOUR, y=1.0)


def frames_of(cut: Cut) -> list[int]:
    """At most six frames that tell what a cut is, in the order of time."""
    before, after = (cut.first + cut.stroke) // 2, (cut.release + cut.last) // 2
    return sorted({cut.first, before, cut.stroke, cut.release, after, cut.last})


def mark(axes: "Axes", clips: Named) -> None:
    """Marks clips on an axis of frames."""
    for name, cut in clips:
        if cut.name == REST:
            continue
        axes.axvspan(cut.first, cut.last, color=COLOUR, alpha=0.12, lw=0)
        axes.annotate(
            name,
            (cut.stroke, 0.02),
            xycoords=("data", "axes fraction"),
            ha="center",
            rotation=90,
            fontsize=8,
            color=COLOUR,
        )


def _title(name: str, cut: Cut, frame: int) -> str:
    said = {cut.release: "released", cut.last: "ends", cut.stroke: "stroke"}
    said[cut.first] = f"{name} ({cut.hands})" if cut.hands in ("left", "right") else name
    return f"{frame}: {said[frame]}" if frame in said else str(frame)
