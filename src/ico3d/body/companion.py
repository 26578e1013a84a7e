"""Companions: other Gaussians, such as a head, that are rendered together with a body in training.

The body learns only what the companion does not show (paper, head–body integration). The companion
is not changed by training, so that windows stay independent of one another.
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
"""Steps between two removals of trespassing Gaussians (paper, head–body integration)."""
MOMENTS = 5
"""Number of evenly spread times of a window, ends included, at which trespassing is tested."""
MOST = MOMENTS // 2 + 1
"""Number of these times from which on a trespassing Gaussian on a skeleton is removed.

One time does not suffice, as a hand may pass the face now and then.
"""


class Companion(Protocol):
    """Gaussians that a body is trained with, and the space that the body may not fill."""

    def gaussians(self, frame: int) -> Gaussians:
        """Activated Gaussians in the world at a frame, without gradient."""
        ...

    def trespassing(self, means: Tensor, frame: float) -> Tensor:
        """Which positions the body may not fill.

        Args:
            means: (N, 3) in the world, metres, on any device.
            frame: Frame of the clip; need not be whole.

        Returns:
            (N,) bool, on the device of `means`.
        """
        ...

    def border(self, frame: int, rng: np.random.Generator) -> np.ndarray:
        """(P, 3) positions near the seam, in the world at a frame, for first Gaussians there."""
        ...


class CompanionSource(Protocol):
    """Describes where a companion is loaded from; small enough to be sent to another process."""

    def open(self, device: torch.device) -> Companion:
        """Loads the companion onto a device."""
        ...

    def about(self) -> dict:
        """JSON-serialisable values that differ whenever the companion's content differs."""
        ...


class Pruning:
    """Removes Gaussians of a window that are where the companion is.

    Their moved positions are tested at `MOMENTS` times of the window. A Gaussian is removed if it
    trespasses at one of these times; on a skeleton, where one window is the whole clip, if it does
    at most of them.
    """

    def __init__(self, companion: Companion, window: Window):
        """Prunes the Gaussians of a window beside a companion."""
        self._companion, self._window = companion, window

    def due(self, step: int, steps: int) -> bool:
        """Whether to prune after step `step` of `steps`: regularly, and after the last one."""
        return (step > 0 and step % PRUNE_EVERY == 0) or step == steps - 1

    @torch.no_grad()
    def carry_out(self, model: WindowModel, population: Population) -> int:
        """Removes the trespassing Gaussians, unless all of them trespass.

        Args:
            model: The window's model.
            population: The same Gaussians with the optimiser's moments, as density control changes
                them.

        Returns:
            Number of Gaussians that were removed.
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
        """(N,) bool: which Gaussians trespass often enough to be removed."""
        window = self._window
        times = torch.zeros(len(model), dtype=torch.int32, device=model.device)
        for tau in np.linspace(0, 1, MOMENTS):
            frame = window.first + tau * (window.last - window.first)
            times += self._companion.trespassing(model.at(float(tau)).means, frame)
        return times >= (MOST if isinstance(model.motion, Skinned) else 1)
