"""Strategies that change the number of Gaussians during training: one interface, two of them.

`DefaultStrategy` is 3DGS (clone, split, prune, opacity reset). `McmcStrategy` is Kheradmand et al.,
"3D Gaussian Splatting as Markov Chain Monte Carlo", 2024. Both work on any device.

gsplat has both strategies, too, but they are bound to torch.optim and to the global random state,
with which a resumed run would not repeat an uninterrupted one, and gsplat's default strategy has no
upper limit. Only gsplat's relocation kernel is used.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ico3d.errors import ModelError
from ico3d.splat import quaternions
from ico3d.splat.density.growth import (
    DensitySettings,
    DensityStats,
    densify_plan,
    reset_opacity_logits,
    under_cap,
)
from ico3d.splat.density.plan import Plan, Population
from ico3d.splat.density.relocation import relocated
from ico3d.splat.rendering import RenderInfo

NOISE_SHARPNESS = 100.0
"""Slope of the sigmoid σ(100·(0.005 − opacity)): only nearly transparent Gaussians are shaken."""


@dataclass(frozen=True)
class Schedule:
    """The steps at which the set of Gaussians changes.

    Attributes:
        begin: First step at which the set may change.
        until: First step at which the set may no longer change.
        every: Steps between two changes.
    """

    begin: int = 500
    until: int = 15_000
    every: int = 100

    def due(self, step: int) -> bool:
        """Whether the set changes after this step."""
        return self.begin <= step < self.until and step % self.every == 0


@dataclass(frozen=True)
class McmcSettings:
    """Settings of the Markov chain; lengths are relative to the scene's extent.

    Attributes:
        max_gaussians: Upper limit on the number of Gaussians.
        min_opacity: Gaussians whose opacity is not above this are relocated.
        growth: Factor by which the number of Gaussians grows at each change, up to the limit.
        noise_rate: λ_noise of the paper: noise on the means is scaled by this factor, by their
            learning rate and by the Gaussian's covariance.
        opacity_weight: λ_o, weight of the mean opacity in the loss.
        scale_weight: λ_Σ, weight of the mean scale in the loss.
    """

    max_gaussians: int = 1_000_000
    min_opacity: float = 0.005
    growth: float = 1.05
    noise_rate: float = 5e5
    opacity_weight: float = 0.01
    scale_weight: float = 0.01


class Strategy(ABC):
    """Changes the set of Gaussians during one training.

    Order within a step: render, add `penalty` to the loss, backward, `observe`, update by the
    optimiser, `adapt`. All randomness depends on the seed and the step's number alone.
    """

    def __init__(self, schedule: Schedule, max_gaussians: int, seed: int):
        """Sets the steps of changes, the upper limit of Gaussians and the seed."""
        self.schedule, self.max_gaussians, self._seed = schedule, max_gaussians, seed

    def penalty(self, population: Population) -> Tensor:
        """A scalar that is added to the loss; 0 unless a subclass defines one."""
        return population.parameters["means"].new_zeros(())

    def observe(self, info: RenderInfo, step: int) -> None:
        """Gathers statistics for the next change; call after `backward`. By default a no-op."""
        del info, step

    def adapt(self, population: Population, step: int, rate: float) -> None:
        """Changes the set of Gaussians if the schedule says so or the limit is exceeded.

        Args:
            population: Changed in place; afterwards it has at most `max_gaussians`.
            step: Number of the step that was just done.
            rate: Learning rate of the means in that step, relative to the scene's extent.

        Raises:
            ModelError: If no Gaussian is left.
        """
        if not self.schedule.due(step) and len(population) <= self.max_gaussians:
            return
        with torch.no_grad():
            self._change(population, step, self._generator(step, 0))
        if len(population) == 0:
            raise ModelError(
                f"all Gaussians have faded by step {step}: lower opacity_rate, or look "
                "for damaged pictures with ico3d capture check."
            )

    @abstractmethod
    def _change(self, population: Population, step: int, generator: torch.Generator) -> None:
        """Carries out a change after a step."""

    def tensors(self) -> dict[str, Tensor]:
        """The statistics gathered so far, for checkpoints."""
        return {}

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Restores the statistics that `tensors` returned."""
        del tensors

    def _generator(self, step: int, purpose: int) -> torch.Generator:
        """Random numbers of one step."""
        return torch.Generator().manual_seed(hash((self._seed, step, purpose)) % 2**63)


class DefaultStrategy(Strategy):
    """3DGS: Gaussians with strong screen-space gradients multiply; faint and huge ones are removed.

    As in 3DGS, huge Gaussians are removed only after the first opacity reset, because sparse
    initial points and distant surfaces need large Gaussians.
    """

    def __init__(self, schedule: Schedule, settings: DensitySettings, seed: int, reset_every: int):
        """Sets schedule and thresholds; the statistics are empty.

        Args:
            schedule: When to densify.
            settings: Thresholds and the upper limit on the number of Gaussians.
            seed: Seed for the positions of the parts of split Gaussians.
            reset_every: Steps between two opacity resets while densifying; 0 for none.
        """
        super().__init__(schedule, settings.max_gaussians, seed)
        self._settings, self._reset_every = settings, reset_every
        self._stats = DensityStats.zeros(0)

    def observe(self, info: RenderInfo, step: int) -> None:
        """Gathers screen-space gradients; call after `backward`."""
        if step >= self.schedule.until:
            return
        if len(self._stats.views) != info.radii.shape[1]:
            self._stats = DensityStats.zeros(info.radii.shape[1], info.radii.device)
        self._stats.add(info)

    def adapt(self, population: Population, step: int, rate: float) -> None:
        """Densifies and prunes on schedule, then resets opacities when a reset is due."""
        super().adapt(population, step, rate)
        resets = self._reset_every and 0 < step < self.schedule.until
        if resets and step % self._reset_every == 0:
            ceiling = 2 * self._settings.prune_opacity
            logits = population.parameters["opacity_logits"]
            population.replace("opacity_logits", reset_opacity_logits(logits, ceiling))
            population.forget("opacity_logits")

    def _change(self, population: Population, step: int, generator: torch.Generator) -> None:
        if len(self._stats.views) != len(population):
            self._stats = DensityStats.zeros(len(population), population.scales.device)
        settings = self._settings
        if not 0 < self._reset_every < step:
            settings = replace(settings, prune_scale=math.inf)
        plan = densify_plan(self._stats, population.scales, population.opacities, settings)
        population.carry_out(plan, generator)
        self._stats = DensityStats.zeros(len(population), population.scales.device)

    def tensors(self) -> dict[str, Tensor]:
        """Screen-space gradients gathered so far."""
        return {"gradient_sum": self._stats.gradient_sum, "views": self._stats.views}

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Restores the gradients that `tensors` returned."""
        self._stats = DensityStats(tensors["gradient_sum"], tensors["views"])


class McmcStrategy(Strategy):
    """Gaussians as samples of a Markov chain, after Kheradmand et al. 2024.

    Faint Gaussians are moved to the places of opaque ones, the set grows, and noise shakes all
    Gaussians that are not clearly opaque.
    """

    def __init__(self, schedule: Schedule, settings: McmcSettings, seed: int, extent: float):
        """Sets schedule, settings and the scene's size.

        Args:
            schedule: When to relocate and to grow.
            settings: Settings of the chain and the upper limit on the number of Gaussians.
            seed: Seed for the choice of copied Gaussians and for the noise.
            extent: Size of the scene in metres, which makes noise and penalty independent of the
                unit.
        """
        super().__init__(schedule, settings.max_gaussians, seed)
        self._settings, self._extent = settings, extent

    def penalty(self, population: Population) -> Tensor:
        """λ_o·mean(opacity) + λ_Σ·mean(scale)/extent: superfluous Gaussians fade and shrink."""
        settings = self._settings
        scales = population.scales.mean() / self._extent
        return (
            settings.opacity_weight * population.opacities.mean() + settings.scale_weight * scales
        )

    def adapt(self, population: Population, step: int, rate: float) -> None:
        """Relocates and adds Gaussians on schedule; adds noise to the means at every step."""
        super().adapt(population, step, rate)
        with torch.no_grad():
            self._shake(population, rate, self._generator(step, 1))

    def _change(self, population: Population, step: int, generator: torch.Generator) -> None:
        del step
        plan = self._plan(population.opacities, generator)
        copies = 1 + torch.bincount(plan.clone_from, minlength=len(population))  # (N,)
        population.carry_out(plan, generator)
        copies = copies[plan.sources]  # (M,)
        several = (copies > 1).nonzero()[:, 0]
        opacities, scales = relocated(
            population.opacities[several], population.scales[several], copies[several]
        )
        opacities = opacities.clamp_min(self._settings.min_opacity)
        for name, value in (("opacity_logits", opacities.logit()), ("log_scales", scales.log())):
            population.parameters[name].detach()[several] = value
        for name in population.parameters:
            population.forget(name, several)

    def _plan(self, opacities: Tensor, generator: torch.Generator) -> Plan:
        """Who lives, and who is copied into the place of the dead and as a newcomer."""
        alive = under_cap(opacities > self._settings.min_opacity, opacities, self.max_gaussians)
        keep = alive.nonzero()[:, 0]
        wanted = min(self.max_gaussians, int(self._settings.growth * len(opacities)))
        none = keep[:0]
        if len(keep) == 0 or wanted <= len(keep):
            return Plan(keep, none, none)
        weights = self._weights(opacities)[keep].double().cpu()
        drawn = torch.multinomial(weights, wanted - len(keep), True, generator=generator)
        return Plan(keep, keep[drawn.to(keep.device)], none)

    def _weights(self, opacities: Tensor) -> Tensor:
        """(N,) how likely each is copied: by opacity (N,)."""
        return opacities

    def _shake(self, population: Population, rate: float, generator: torch.Generator) -> None:
        """Adds Σ·ξ / extent, times noise and learning rate, to the means of the faint."""
        means, scales = population.parameters["means"].detach(), population.scales
        threshold = self._settings.min_opacity
        faint = torch.sigmoid(NOISE_SHARPNESS * (threshold - population.opacities))  # (N,)
        noise = torch.randn(means.shape, generator=generator).to(means)  # (N, 3)
        noise *= (faint * rate * self._settings.noise_rate / self._extent)[:, None]
        turns = quaternions.to_matrix(population.parameters["quats"])  # (N, 3, 3)
        turned = scales**2 * (turns.mT @ noise[..., None])[..., 0]  # (N, 3)
        means += (turns @ turned[..., None])[..., 0]
