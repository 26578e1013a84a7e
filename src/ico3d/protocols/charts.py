"""Charts and strips of pictures for reports."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ico3d.common.files import read_small
from ico3d.measure.methods.plots import new_figure, save_figure
from ico3d.training.log import METRICS

SMOOTHED = 25
"""A training's PSNR is shown as a running mean over this part of its entries: one in so many."""
LARGEST_ERROR = 0.2
"""Colour difference, of 1, that error maps show brightest."""

Trial = tuple[float, float]
"""A figure of one training, and its quality in dB."""


def draw_quality(
    path: Path, panels: Mapping[str, Mapping[str, Sequence[Trial]]], quality: str
) -> None:
    """Draws the quality of trainings against other figures of them, a panel for each figure.

    Args:
        path: The PNG file.
        panels: By the figure's name (`training, s`): by method, one point for each training.
        quality: Label of the axis of quality.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5 * len(panels), 4), dpi=120, layout="constrained")
    all_axes = np.atleast_1d(figure.subplots(1, len(panels), sharey=True))
    for axes, (name, methods) in zip(all_axes, panels.items(), strict=True):
        for method, trials in methods.items():
            axes.plot(*zip(*trials, strict=True), "o", label=method)
        axes.set_xlabel(name)
        axes.grid(alpha=0.3)
    all_axes[0].set_ylabel(quality)
    all_axes[0].legend(fontsize=8)
    save_figure(figure, path)


def draw_training(path: Path, runs: Mapping[str, tuple[Path, float]]) -> None:
    """Draws how trainings went: PSNR of their training pictures over time and over Gaussians.

    Args:
        path: The PNG file.
        runs: By name: folder of the model, and the seconds that its training took.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), dpi=120, layout="constrained")
    over_time, over_count = figure.subplots(1, 2, sharey=True)
    for name, (folder, seconds) in runs.items():
        lines = read_small(folder / METRICS).splitlines()
        steps, psnr, count = np.array(
            [
                [entry[key] for key in ("step", "psnr", "gaussians")]
                for entry in map(json.loads, lines)
            ]
        ).T
        width = max(1, len(psnr) // SMOOTHED)
        smooth = np.convolve(psnr, np.ones(width) / width, "valid")
        late = slice(len(psnr) - len(smooth), None)
        over_time.plot(seconds * steps[late] / steps[-1], smooth, label=name)
        over_count.plot(count[late], smooth, ".", label=name)
    over_time.set_xlabel("training, s")
    over_count.set_xlabel("Gaussians")
    over_time.set_ylabel("PSNR of training pictures, running mean (dB)")
    over_time.legend(fontsize=8)
    for axes in (over_time, over_count):
        axes.grid(alpha=0.3)
    save_figure(figure, path)


def draw_lines(path: Path, lines: Mapping[str, Sequence[float | None]], x: str, y: str) -> None:
    """Draws series of numbers over their places; None leaves a gap."""
    from matplotlib.ticker import MaxNLocator

    figure, axes = new_figure(9, y)
    for label, values in lines.items():
        axes.plot([np.nan if v is None else v for v in values], ".-", label=label, linewidth=1)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel(x)
    axes.legend(fontsize=8)
    save_figure(figure, path)


def draw_strip(path: Path, truth: np.ndarray, drawn: Mapping[str, np.ndarray]) -> None:
    """Draws a recorded picture and those of models, and maps of their errors below.

    Args:
        path: The PNG file.
        truth: (H, W, 3) recorded picture in [0, 1].
        drawn: (H, W, 3) pictures of the same view by name.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    scale = ScalarMappable(Normalize(0, LARGEST_ERROR), "magma")
    count, shape = len(drawn) + 1, truth.shape[0] / truth.shape[1]
    figure = Figure(figsize=(2.2 * count, 4.4 * shape + 0.5), dpi=120, layout="constrained")
    grid = figure.subplots(2, count, squeeze=False)
    for axes in grid.flat:
        axes.axis("off")
    grid[0, 0].imshow(truth)
    grid[0, 0].set_title("recorded", fontsize=9)
    for column, (name, picture) in enumerate(drawn.items(), 1):
        grid[0, column].imshow(np.clip(picture, 0, 1))
        grid[0, column].set_title(name, fontsize=9)
        error = np.abs(picture - truth).mean(-1)  # (H, W)
        grid[1, column].imshow(error, norm=scale.norm, cmap=scale.cmap)
    figure.colorbar(scale, ax=grid[1, 0], location="left", fraction=0.3, label="mean error")
    save_figure(figure, path)
