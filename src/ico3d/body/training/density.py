"""Density control of bodies: 3DGS's for most methods, relocation for FreeTime."""

from torch import Tensor

from ico3d.body.settings import BodySettings, Method
from ico3d.splat.density import (
    DefaultStrategy,
    DensitySettings,
    DensityStats,
    McmcSettings,
    McmcStrategy,
    Schedule,
    Strategy,
)
from ico3d.splat.rendering import RenderInfo

CLONE_BELOW = 0.01
PRUNE_ABOVE = 0.1
"""Sizes of Gaussians, relative to the extent, below which they are cloned and above which pruned.

Both are those of 3DGS.
"""
FADING = 1e-3
"""Weight of the mean opacity in FreeTime's loss, by which unneeded Gaussians fade."""


class RelocationStrategy(McmcStrategy):
    """FreeTime's density control: faint Gaussians move to where gradient and opacity are high.

    It is the Markov chain strategy with another choice of where Gaussians move to.
    """

    def __init__(self, schedule: Schedule, settings: McmcSettings, seed: int, extent: float):
        """Makes a strategy that has gathered no gradients yet.

        Args:
            schedule: Steps at which Gaussians move.
            settings: Settings of the Markov chain strategy.
            seed: Seed of the choice of Gaussians.
            extent: Half the longest edge of the person's bounding box, metres.
        """
        super().__init__(schedule, settings, seed, extent)
        self._stats = DensityStats.zeros(0)

    def observe(self, info: RenderInfo, step: int) -> None:
        """Gathers the screen-space gradients of a rendering."""
        del step
        if len(self._stats.views) != info.radii.shape[1]:
            self._stats = DensityStats.zeros(info.radii.shape[1], info.radii.device)
        self._stats.add(info)

    def _weights(self, opacities: Tensor) -> Tensor:
        """(N,) gradient plus opacity, each relative to its mean; empties the gathered gradients."""
        gradient = self._stats.mean_gradient()
        self._stats = DensityStats.zeros(0)
        if len(gradient) != len(opacities):
            return opacities
        return gradient / gradient.mean().clamp_min(1e-12) + opacities / opacities.mean()

    def tensors(self) -> dict[str, Tensor]:
        """Gradients gathered so far, for a checkpoint."""
        return {"gradient_sum": self._stats.gradient_sum, "views": self._stats.views}

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Restores the state that `tensors` returned."""
        self._stats = DensityStats(tensors["gradient_sum"], tensors["views"])


def density_control(
    method: Method, settings: BodySettings, steps: int, seed: int, extent: float
) -> Strategy:
    """The density control of a method.

    Args:
        method: How Gaussians are moved.
        settings: Settings of the body.
        steps: Steps of the window's training.
        seed: Seed of its random choices.
        extent: Half the longest edge of the person's bounding box, metres.
    """
    density = settings.density
    schedule = Schedule(density.begin, round(density.until * steps), density.every)
    if method == "freetime":
        chain = McmcSettings(
            max_gaussians=density.max_gaussians,
            min_opacity=density.min_opacity,
            growth=1 + density.growth,
            noise_rate=0.0,
            opacity_weight=FADING,
            scale_weight=0.0,
        )
        return RelocationStrategy(schedule, chain, seed, extent)
    thresholds = DensitySettings(
        max_gaussians=density.max_gaussians,
        gradient_threshold=density.gradient,
        growth=density.growth,
        clone_below=CLONE_BELOW * extent,
        prune_opacity=density.min_opacity,
        prune_scale=PRUNE_ABOVE * extent,
    )
    return DefaultStrategy(schedule, thresholds, seed, reset_every=0)
