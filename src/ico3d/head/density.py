"""Density control of a head: applies the plans of `splat.density` to model and moments."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from ico3d.errors import ModelError
from ico3d.head.model import HeadModel
from ico3d.head.settings import Density
from ico3d.splat.density import (
    DensitySettings,
    DensityStats,
    Plan,
    Population,
    densify_plan,
    growth_plan,
)
from ico3d.splat.rendering import RenderInfo
from ico3d.training.optimiser import Optimiser

CLONE_BELOW = 0.01
PRUNE_ABOVE = 0.1
"""Both sizes are relative to the box of the initial points; in 3DGS, to the scene's extent."""


def bound_scales(model: HeadModel) -> None:
    """Limits the size of every Gaussian, in place, as density control would.

    Density control ends before training does. Afterwards an unconstrained Gaussian could grow into
    a long beam that is visible from directions without a camera.
    """
    largest = PRUNE_ABOVE * model.shape.box_size
    model.log_scales.data.clamp_(max=math.log(largest))


@dataclass(frozen=True)
class Sampled:
    """Maxima over some frames, for each Gaussian.

    Attributes:
        opacities: (N,) largest predicted opacity.
        contributions: (N,) largest contribution to a picture: blending weights summed over pixels.
    """

    opacities: Tensor
    contributions: Tensor


class HeadDensity:
    """Clones, splits and prunes; clones and parts copy the basis (F and f_0)."""

    def __init__(self, settings: Density, seed: int):
        """Sets thresholds and seed; the statistics are empty."""
        self._settings, self._seed = settings, seed
        self._stats = DensityStats.zeros(0)

    def observe(self, info: RenderInfo, step: int) -> None:
        """Gathers screen-space gradients; call after `backward`."""
        if step >= self._settings.until:
            return
        if len(self._stats.views) != info.radii.shape[1]:
            self._stats = DensityStats.zeros(info.radii.shape[1], info.radii.device)
        self._stats.add(info)

    def adapt(
        self,
        model: HeadModel,
        optimiser: Optimiser,
        sample: Callable[[int], Sampled],
        step: int,
    ) -> None:
        """Densifies and prunes on schedule.

        Args:
            model: The head, changed in place.
            optimiser: Holds the moments, which are changed like the model; new Gaussians start with
                0.
            sample: Returns maxima over some frames, which depend on the step's number.
            step: Number of the step that was just done.

        Raises:
            ModelError: If no Gaussian is left.
        """
        settings = self._settings
        due = settings.begin <= step < settings.until
        if not due or step % settings.every:
            return
        thresholds = DensitySettings(
            max_gaussians=settings.max_gaussians,
            gradient_threshold=settings.gradient,
            clone_below=CLONE_BELOW * model.shape.box_size,
            prune_opacity=settings.min_opacity,
            prune_scale=PRUNE_ABOVE * model.shape.box_size,
            prune_contribution=settings.min_contribution,
        )
        seen = sample(step)
        plan = densify_plan(
            self._stats, model.log_scales.exp(), seen.opacities, thresholds, seen.contributions
        )
        if len(plan) == 0:
            raise ModelError.of(
                "faded",
                after=" Lower --rates.mlp, or give the capture masks and raise --loss.alpha.",
                values={"step": step},
            )
        generator = torch.Generator().manual_seed(hash((self._seed, step)) % 2**63)
        _carry_out(plan, model, optimiser, generator)
        self._stats = DensityStats.zeros(len(model), model.means.device)

    def grow(self, model: HeadModel, optimiser: Optimiser, count: int) -> None:
        """Splits Gaussians at random until there are `count`."""
        generator = torch.Generator().manual_seed(self._seed)
        while len(model) < count:
            _carry_out(growth_plan(len(model), count, generator), model, optimiser, generator)

    def tensors(self) -> dict[str, Tensor]:
        """Gradients, and the number of views that gave them, since the last densification."""
        return {"gradient_sum": self._stats.gradient_sum, "views": self._stats.views}

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Restores the statistics that `tensors` returned."""
        self._stats = DensityStats(tensors["gradient_sum"], tensors["views"])


def _carry_out(
    plan: Plan, model: HeadModel, optimiser: Optimiser, generator: torch.Generator
) -> None:
    """Applies a plan to parameters and moments."""
    values = {name: getattr(model, name).detach() for name in model.gaussian_axes}
    population = Population(values, optimiser.moments, model.gaussian_axes)
    population.carry_out(plan, generator)
    model.resize(len(plan))
    for name, value in population.parameters.items():
        getattr(model, name).data = value
