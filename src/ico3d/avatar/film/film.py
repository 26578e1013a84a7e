"""Rendering somebody who moves along a path of cameras."""

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
import torch

from ico3d.common.camera import Camera
from ico3d.splat.device import CPU
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.render import render

MOMENTS = 9
"""Of a clip, at which is looked where the person goes."""
SEEN = 0.1
"""Opacity from which a Gaussian counts for where the person is."""


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


@torch.no_grad()
def pictures(
    person: Moving,
    cameras: Sequence[Camera],
    fps: float,
    background: Sequence[float],
    backdrop: Gaussians | None = None,
    device: torch.device = CPU,
) -> Iterator[np.ndarray]:
    """What the cameras see one after the other while time runs, back and forth through the clip.

    Args:
        person: Who moves.
        cameras: One per picture.
        fps: Pictures per second.
        background: (3,) colour in [0, 1].
        backdrop: What stands behind the person, in the world.
        device: Where they are drawn.

    Yields:
        (H, W, 3) uint8.
    """
    behind = torch.tensor(background)
    around = [] if backdrop is None else [backdrop.to(device)]
    for number, camera in enumerate(cameras):
        shown = person.gaussians(back_and_forth(number / fps, person.seconds)).to(device)
        rgb = render(cat([shown, *around]), [camera], behind).rgb[0].clamp(0, 1)  # (H, W, 3)
        yield (rgb * 255 + 0.5).to(torch.uint8).cpu().numpy()
