"""A plan of windows as a picture: the motion curve, the windows, and frames of the recording."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ico3d.body.planning.plan import Plan
from ico3d.body.planning.windows import Window
from ico3d.capture.capture import Capture
from ico3d.common.files import write_atomic
from ico3d.common.spread import spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = "tab10"
MOST_PICTURES = 14
"""Most frames that are shown."""
MARGIN = 0.05
"""Margin around the person, relative to the height of the recorded picture."""
TITLE = 1.0
"""Height of titles in heights of their axes; given, as matplotlib is slow to find a free place."""


def draw_plan(plan: Plan, capture: Capture, path: Path) -> None:
    """Draws a plan into a PNG file.

    A chart shows the motion of each step, coloured by window, and its sum within each window, which
    the threshold bounds. Below are pictures of the busiest camera, of frames at which the clip is
    cut and in the middle of windows.

    Args:
        plan: The windows and the motion.
        capture: The recording.
        path: The file to write.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 7.5))
    FigureCanvasAgg(figure)
    _curve(figure.add_axes((0.05, 0.44, 0.9, 0.52)), plan)
    frames = _shown(plan.windows)
    box = _person(capture, plan.busiest, frames)
    _pictures(figure, capture, plan.busiest, frames, box)
    write_atomic(path, lambda file: figure.savefig(file, format="png", dpi=100))


def _curve(axes: "Axes", plan: Plan) -> None:
    """Draws motion as bars, and its sum within each window as a line."""
    from matplotlib import colormaps

    colors = colormaps[COLORS].colors  # type: ignore (its stub knows the base class alone)
    sums = axes.twinx()
    for number, window in enumerate(plan.windows):
        color = colors[number % len(colors)]
        steps = np.arange(window.first, window.last)
        motion = np.array(plan.motion[window.first : window.last])
        axes.bar(steps + 0.5, motion, 0.9, color=color)
        frames = np.arange(window.first, window.last + 1)
        sums.plot(frames, np.concatenate([[0], motion.cumsum()]), color=color, alpha=0.6)
        axes.axvspan(window.first, window.last, color=color, alpha=0.08, lw=0)
        label = f"{number}\n{window.first}–{window.last}\n{plan.moved(window):.1f} cm²"
        middle = (window.first + window.last) / 2
        axes.annotate(
            label, (middle, 0.98), xycoords=("data", "axes fraction"), ha="center", va="top"
        )
    for window, _ in pairwise(plan.windows):
        axes.axvline(window.last, color="black", lw=0.8)
    bound = plan.settings.threshold
    sums.axhline(bound, color="grey", ls="--", lw=0.8)
    axes.set(
        xlim=(plan.windows[0].first, max(plan.windows[-1].last, 1)),
        ylim=(0, 1.3 * max(*plan.motion, 1e-9) if plan.motion else 1),
        xlabel="frame",
        ylabel="motion of a step, cm² per foreground pixel (bars)",
    )
    axes.set_title(f"{len(plan.windows)} windows; motion by {plan.method}", y=TITLE)
    sums.set_ylim(0, 1.3 * max([bound, *map(plan.moved, plan.windows)]))
    sums.set_ylabel("sum within the window, cm² (lines); threshold (dashed)")


def _shown(windows: Sequence[Window]) -> list[int]:
    """The frames to show: ends and middles of windows; of too many, some evenly spread ends."""
    ends = [windows[0].first, *(window.last for window in windows)]
    frames = sorted({*ends, *(window.center for window in windows)})
    frames = frames if len(frames) <= MOST_PICTURES else ends
    return [frames[place] for place in spread(len(frames), MOST_PICTURES)]


def _person(capture: Capture, camera: int, frames: list[int]) -> tuple[slice, slice]:
    """Rows and columns that hold the person in all these frames; all of them without masks."""
    lens = capture.cameras[camera]
    found = np.zeros((lens.height, lens.width), bool)
    for frame in frames:
        mask = capture.mask(camera, frame)
        if mask is not None:
            found |= mask > 0.5
    if not found.any():
        return slice(None), slice(None)
    spans = []
    for axis, size in ((1, lens.height), (0, lens.width)):
        places = np.flatnonzero(found.any(axis))
        margin = round(MARGIN * lens.height)
        spans.append(slice(max(places[0] - margin, 0), min(places[-1] + margin, size)))
    return spans[0], spans[1]


def _pictures(
    figure: "Figure", capture: Capture, camera: int, frames: list[int], box: tuple[slice, slice]
) -> None:
    """Draws frames of a camera in a row below the curve, cropped to rows and columns `box`."""
    width = 0.98 / len(frames)
    for number, frame in enumerate(frames):
        left = 0.01 + width * number
        figure.text(left + width / 2, 0.36, f"frame {frame}", ha="center", fontsize=9)
        image = capture.image(camera, frame)
        if image is None:
            continue
        axes = figure.add_axes((left, 0.01, 0.96 * width, 0.34))
        axes.imshow(np.clip(image[box], 0, 1))
        axes.axis("off")
