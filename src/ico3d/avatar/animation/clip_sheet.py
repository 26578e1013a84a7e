"""The part of a contact sheet that shows recorded clips: gestures cut out of a recording."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ico3d.motion.recorded.cut import REST, Cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

COLUMNS = 6
MOST = 20
"""Most clips that are shown; the rest is left out."""
ROW = 2.6
"""Height in inches of the row of one clip."""
COLOUR = "tab:purple"
Named = Sequence[tuple[str, Cut]]
"""Clips with their names, in order of time."""


def height(clips: Named) -> float:
    """Height in inches of the rows of these clips."""
    return ROW * min(len(clips), MOST)


def draw_clips(place: "SubFigure", clips: Named, picture: Callable[[int], np.ndarray]) -> None:
    """Draws a row of pictures for each clip, from its first to its last frame (`frames_of`).

    Args:
        place: Part of the figure to draw into.
        clips: Clips with their names; `MOST` of them are drawn.
        picture: Returns the picture (H, W, 3) of the person at a frame.
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
    """Up to six frames that show a cut: its marks, and frames between them, in order of time."""
    before, after = (cut.first + cut.stroke) // 2, (cut.release + cut.last) // 2
    return sorted({cut.first, before, cut.stroke, cut.release, after, cut.last})


def mark(axes: "Axes", clips: Named) -> None:
    """Marks the frames of clips in a chart whose x axis counts frames."""
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
