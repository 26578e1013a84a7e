"""Protocols of what moves through the time of a clip: bodies and whole persons."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import torch

from ico3d.errors import BundleError
from ico3d.splat.gaussians import Gaussians

MOMENTS = 9
"""Number of moments of a clip that are sampled to find the space a person fills."""
SEEN = 0.1
"""Opacity above which a Gaussian counts for the space a person fills."""


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


def tau_in(span: Span, frame: float) -> float:
    """Time τ in a span: 0 at its first frame and 1 at its last; 0 in a span of one frame."""
    return (frame - span.first) / max(span.last - span.first, 1)


class MovingBody(Protocol):
    """A body that can be baked: `ico3d.body.model_folder.TrainedBody`, or one of its shape.

    Attributes:
        fps: Frames per second.
        summary: How the body was made; key `capture` has the provenance of its recording.
    """

    fps: float
    summary: dict

    @property
    def windows(self) -> Sequence[Span]:
        """Spans of time with Gaussians of their own; neighbours share one frame."""
        ...

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        """The Gaussians of a window in the world at τ in [0, 1].

        They have `colors`, and their number is the same at every τ of a window.
        """
        ...


def check_moves(body: MovingBody) -> None:
    """Refuses a body of a single frame, which neither a bundle nor an animation can hold.

    Raises:
        BundleError: If the clip has one frame.
    """
    if body.windows[-1].last == 0:
        raise BundleError(
            "the body has one frame, so it does not move: a bundle or an animation needs a body of "
            "two frames or more."
        )


class Moving(Protocol):
    """A moving person as Gaussians of the time, such as `ico3d.body.model_folder.TrainedBody`."""

    @property
    def seconds(self) -> float:
        """Length of the clip in seconds."""
        ...

    def gaussians(self, seconds: float) -> Gaussians:
        """Activated Gaussians in the world at a time in seconds."""
        ...


def back_and_forth(seconds: float, length: float) -> float:
    """Time in a clip that plays forwards and backwards without end.

    Args:
        seconds: How long it has been playing.
        length: Length of the clip in seconds; where it is 0, the result is 0.
    """
    if length <= 0:
        return 0.0
    around = seconds % (2 * length)
    return min(around, 2 * length - around)


@torch.no_grad()
def extent(person: Moving) -> np.ndarray:
    """(P, 3) float64 positions of a person's visible Gaussians at moments of the whole clip.

    Strays are left out: those beyond the 0.2 % and 99.8 % quantile of a coordinate.
    """
    places = []
    for moment in np.linspace(0, person.seconds, MOMENTS):
        gaussians = person.gaussians(float(moment))
        places.append(gaussians.means[gaussians.opacities > SEEN].cpu().numpy())
    points = np.concatenate(places).astype(np.float64)  # (P, 3)
    low, high = np.percentile(points, (0.2, 99.8), axis=0)  # (3,), (3,)
    return points[((points >= low) & (points <= high)).all(1)]
