"""Where Gaussians lie along the line of sight, for heads that are seen from about one side.

A step of Adam is as long for a gradient that is noise. Across the line of sight pictures say where
a Gaussian belongs; along it they hardly do while a head turns by a few degrees only, so that each
Gaussian strays for itself: seen from the side, hair is spikes and cheeks have holes. Neighbours lie
on one surface. So along the line of sight Gaussians take their steps together, and none is longer
there than it is wide. Not in the paper.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ico3d.head.views import View
from ico3d.splat.quaternions import to_matrix

ONE_SIDE = 0.3
"""Root mean square of the sines of the angles between all views and their mean, below which a head
counts as seen from one side."""
CELL = 0.004
"""Edge in metres of the cells across the line of sight whose Gaussians step together."""
CELLS = 256
"""Most cells along each axis; what lies beyond counts as in the outermost one."""
BLUR = (0.06136, 0.24477, 0.38774, 0.24477, 0.06136)
"""Weights of a cell and its neighbours: a Gaussian as wide as a cell."""
SHORTENED_EVERY = 10
"""Steps after which Gaussians that are too long are shortened."""
SHORTEST = 0.74
"""Smallest factor by which an axis is shortened at once."""


@dataclass(frozen=True)
class Sight:
    """The directions from which the pictures of a training show a head.

    Attributes:
        axes: (3, 3) orthonormal rows in canonical head space: two across the line of sight, then
            the mean direction from the head to the cameras.
    """

    axes: Tensor

    def together(self, means: Tensor, before: Tensor) -> Tensor:
        """Centres (N, 3) whose steps along the line of sight are the same as their neighbours'.

        Args:
            means: (N, 3) centres after a step.
            before: (N, 3) centres before it.
        """
        axes = self.axes.to(means)
        along = (means - before) @ axes[2]  # (N,)
        return means + (shared(along, means @ axes[:2].T) - along)[:, None] * axes[2]

    def shortened(self, log_scales: Tensor, quats: Tensor) -> Tensor:
        """Logarithms (N, 3) of half widths that are nearer to being as long as wide, or are so.

        Args:
            log_scales: (N, 3) logarithms of the Gaussians' half widths along their own axes.
            quats: (N, 4) their rotations.
        """
        axes = self.axes.to(log_scales)
        spread = axes @ to_matrix(quats) * log_scales.exp()[:, None]  # (N, 3, 3): axes × own axes
        long = spread[:, 2].norm(dim=1)  # (N,)
        factor = (_width(spread[:, :2]) / long).clamp(SHORTEST, 1.0)  # (N,)
        chosen = spread[:, 2].abs().argmax(1, keepdim=True)  # (N, 1)
        return log_scales.scatter_add(1, chosen, factor.log()[:, None])


def sight_of(views: Sequence[View]) -> Sight | None:
    """The line of sight of views in canonical head space; None where they show several sides."""
    places = np.stack([view.camera.camera_to_world[:3, 3] for view in views])  # (V, 3)
    directions = places / np.linalg.norm(places, axis=1, keepdims=True)
    middle = directions.mean(0) / np.linalg.norm(directions.mean(0))
    spread = np.sqrt(np.mean(1 - np.minimum(directions @ middle, 1) ** 2))
    if spread > ONE_SIDE or (directions @ middle < 0).any():
        return None
    across = np.linalg.svd(middle[None])[2][1:]  # (2, 3)
    return Sight(torch.from_numpy(np.concatenate([across, middle[None]])).float())


def _width(spread: Tensor) -> Tensor:
    """Largest singular values (N,) of matrices (N, 2, 3): half widths in a plane."""
    first, second = spread.unbind(1)  # (N, 3) each
    a, b, c = (x.mul(y).sum(1) for x, y in ((first, first), (second, second), (first, second)))
    return ((a + b) / 2 + (((a - b) / 2) ** 2 + c**2).sqrt()).sqrt()  # (N,)


def shared(values: Tensor, places: Tensor) -> Tensor:
    """Means (N,) of values over all that lie near in a plane, by cells.

    Args:
        values: (N,) values.
        places: (N, 2) places in metres.
    """
    cells = ((places - places.amin(0)) / CELL).long().clamp_(max=CELLS - 1)  # (N, 2)
    height, width = (cells.amax(0) + 1).tolist()
    index = cells[:, 0] * width + cells[:, 1]  # (N,)
    sums = values.new_zeros(2, height * width)
    sums[0].index_add_(0, index, values)
    sums[1].index_add_(0, index, torch.ones_like(values))
    kernel = values.new_tensor(BLUR)
    grid = sums.view(2, 1, height, width)
    grid = functional.conv2d(grid, kernel.view(1, 1, -1, 1), padding=(len(BLUR) // 2, 0))
    grid = functional.conv2d(grid, kernel.view(1, 1, 1, -1), padding=(0, len(BLUR) // 2))
    total, count = grid.view(2, -1)[:, index]
    return total / count
