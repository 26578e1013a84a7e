"""Other Gaussians that a body is trained with, in one rendering pass: a head, for example.

The body learns to be what the companion is not (paper, head–body integration); the companion does
not change meanwhile, so that windows stay independent of one another.
"""

from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.body.skinning.skinned import Skinned
from ico3d.splat.density import Plan, Population
from ico3d.splat.gaussians import Gaussians

PRUNE_EVERY = 100
"""Steps between two removals of what trespasses (paper, same section)."""
MOMENTS = 5
"""Of a window, at which is looked who trespasses: its ends, its middle and between them."""
MOST = MOMENTS // 2 + 1
"""Of these, at which a Gaussian on a skeleton trespasses that belongs to the companion's place; a
hand passes the face now and then, and is a hand all the same."""


class Companion(Protocol):
    """Somebody who stands where the body must not be."""

    def gaussians(self, frame: int) -> Gaussians:
        """Activated Gaussians in the world at a frame, without gradient."""
        ...

    def trespassing(self, means: Tensor, frame: float) -> Tensor:
        """Which places the body must not fill.

        Args:
            means: (N, 3) in the world, on any device.
            frame: When; may lie between two frames.

        Returns:
            (N,) bool.
        """
        ...

    def border(self, frame: int, rng: np.random.Generator) -> np.ndarray:
        """(P, 3) places in the world about the seam, for Gaussians that shall close it."""
        ...


class CompanionSource(Protocol):
    """Where a companion comes from; small, and can be sent to another process."""

    def open(self, device: torch.device) -> Companion:
        """Makes the companion."""
        ...

    def about(self) -> dict:
        """What runs are known by: other content, other dict; JSON-serialisable."""
        ...


class Pruning:
    """Removes the Gaussians of a window that trespass at any time of it.

    Where they are while they move counts, not where they are stored. On a skeleton one window is
    the whole clip, so what trespasses for most of the time is removed, elsewhere what ever does.
    """

    def __init__(self, companion: Companion, window: Window):
        """Looks at `MOMENTS` of the window."""
        self._companion, self._window = companion, window

    def due(self, step: int, steps: int) -> bool:
        """Whether to remove after a step of so many: every now and then, and after the last."""
        return (step > 0 and step % PRUNE_EVERY == 0) or step == steps - 1

    @torch.no_grad()
    def carry_out(self, model: WindowModel, population: Population) -> int:
        """Removes the Gaussians that trespass, with their moments.

        Args:
            model: The window's Gaussians.
            population: The body's Gaussians, as density control sees them.

        Returns:
            How many Gaussians were removed.
        """
        trespass = self.trespassing(model)
        keep = torch.nonzero(~trespass)[:, 0]  # (K,)
        if len(keep) == len(model) or len(keep) == 0:
            return 0
        none = keep.new_zeros(0)
        population.carry_out(Plan(keep, none, none), torch.Generator())
        return int(trespass.sum())

    @torch.no_grad()
    def trespassing(self, model: WindowModel) -> Tensor:
        """(N,) bool: those that are where they must not be, at one of the moments or at most."""
        window = self._window
        times = torch.zeros(len(model), dtype=torch.int32, device=model.device)
        for tau in np.linspace(0, 1, MOMENTS):
            frame = window.first + tau * (window.last - window.first)
            times += self._companion.trespassing(model.at(float(tau)).means, frame)
        return times >= (MOST if isinstance(model.motion, Skinned) else 1)
