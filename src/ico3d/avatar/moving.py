"""What moves through the time of a clip: bodies and whole persons."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import torch

from ico3d.splat.gaussians import Gaussians

MOMENTS = 9
"""Of a clip, at which is looked where the person goes."""
SEEN = 0.1
"""Opacity from which a Gaussian counts for where the person is."""


class Span(Protocol):
    """Frames first … last, both included."""

    @property
    def first(self) -> int:
        """The first frame."""
        ...

    @property
    def last(self) -> int:
        """The last frame."""
        ...


class MovingBody(Protocol):
    """What is baked: `ico3d.body.model_folder.TrainedBody`, or anything that moves like it.

    Attributes:
        fps: Frames per second.
        summary: How it was made; `capture` is the provenance of its recording.
    """

    fps: float
    summary: dict

    @property
    def windows(self) -> Sequence[Span]:
        """Spans of time with Gaussians of their own; neighbours share one frame."""
        ...

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        """The Gaussians of a window at τ in [0, 1], with `colors`; always equally many."""
        ...


class Moving(Protocol):
    """Somebody who moves: `ico3d.body.model_folder.TrainedBody`, or anything that moves like it."""

    @property
    def seconds(self) -> float:
        """How long the clip lasts."""
        ...

    def gaussians(self, seconds: float) -> Gaussians:
        """Activated Gaussians in the world at a time."""
        ...


def back_and_forth(seconds: float, length: float) -> float:
    """The moment of a clip of some length that shows after so many seconds of endless play."""
    if length <= 0:
        return 0.0
    around = seconds % (2 * length)
    return min(around, 2 * length - around)


@torch.no_grad()
def extent(person: Moving) -> np.ndarray:
    """(P, 3) places that somebody fills in the course of the clip, without stray Gaussians."""
    places = []
    for moment in np.linspace(0, person.seconds, MOMENTS):
        gaussians = person.gaussians(float(moment))
        places.append(gaussians.means[gaussians.opacities > SEEN].cpu().numpy())
    points = np.concatenate(places).astype(np.float64)  # (P, 3)
    low, high = np.percentile(points, (0.2, 99.8), axis=0)  # (3,), (3,)
    return points[((points >= low) & (points <= high)).all(1)]
