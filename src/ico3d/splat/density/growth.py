"""Adaptive density control of 3D Gaussian Splatting: which Gaussians clone, split and die."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log

import torch
from torch import Tensor

from ico3d.common.camera import Camera
from ico3d.splat.density.plan import SPLIT_SHRINK, Plan
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from ico3d.splat.rendering import RenderInfo

SPLIT_PARTS = 2
"""A Gaussian that is too large becomes this many."""


@dataclass(frozen=True)
class DensitySettings:
    """When Gaussians multiply and die.

    Attributes:
        max_gaussians: Never more than this many; the strongest gradients win.
        gradient_threshold: Mean screen gradient (normalised device units) above which a Gaussian
            multiplies.
        clone_below: Gaussians whose largest scale is up to this are cloned, larger ones split,
            metres. 3DGS: 1 % of the scene's extent.
        prune_opacity: Those whose opacity falls below this die.
        prune_scale: Those whose largest scale exceeds this die, metres. 3DGS: 10 % of the
            scene's extent.
        prune_contribution: Those that give pictures less than this times the median die.
        growth: Part of the Gaussians that multiplies at once at most, those of strongest gradient.
    """

    max_gaussians: int = 50_000
    gradient_threshold: float = 2e-4
    clone_below: float = 0.002
    prune_opacity: float = 0.005
    prune_scale: float = 0.05
    prune_contribution: float = 0.0
    growth: float = 1.0


@dataclass
class DensityStats:
    """Screen gradients gathered between two densifications.

    Attributes:
        gradient_sum: (N,) sum over the views that saw a Gaussian.
        views: (N,) number of those views.
    """

    gradient_sum: Tensor
    views: Tensor

    @staticmethod
    def zeros(count: int, device: torch.device | str = "cpu") -> "DensityStats":
        """Statistics of `count` Gaussians, nothing gathered."""
        return DensityStats(torch.zeros(count, device=device), torch.zeros(count, device=device))

    def add(self, info: RenderInfo) -> None:
        """Gathers from a render after `backward`.

        With a loss that averages over C cameras the gradients are C times too small; they are
        scaled back, so that the threshold means the same for any number of cameras.

        Raises:
            RuntimeError: If `backward` has not run.
        """
        visible = info.visible  # (C, N)
        norms = info.screen_gradients() * len(visible)  # (C, N)
        self.gradient_sum += (norms * visible).sum(0)
        self.views += visible.sum(0)

    def mean_gradient(self) -> Tensor:
        """(N,) mean over the views that saw a Gaussian; 0 where none did."""
        return self.gradient_sum / self.views.clamp_min(1)


def contributions(gaussians: Gaussians, cameras: Sequence[Camera]) -> Tensor:
    """What each Gaussian gives pictures: (C, N) the sum over pixels of its blending weight.

    What lies behind others, or between pixels, gives next to nothing however opaque it is.
    """
    gaussians = gaussians.detach()
    one = gaussians.means.new_zeros(len(gaussians), 3).requires_grad_()
    given: list[Tensor] = []
    for camera in cameras:
        colored = replace(gaussians, colors=one, sh=None)
        with torch.enable_grad():
            total = render(colored, [camera]).rgb[..., 0].sum()
            given.append(torch.autograd.grad(total, one)[0][:, 0])  # (N,): d(Σ w·c)/dc
    return torch.stack(given)


def densify_plan(
    stats: DensityStats,
    scales: Tensor,
    opacities: Tensor,
    settings: DensitySettings,
    contribution: Tensor | None = None,
) -> Plan:
    """Decides what multiplies and what dies (3DGS section 5).

    Pruned are the faint, the hidden and those that would still be too large after their split;
    only the others multiply. Where the cap leaves no room for all of them, those of the strongest
    gradient go first; where even those that stay are too many, the faintest die.

    Args:
        stats: What was gathered since the last plan.
        scales: (N, 3) activated, metres.
        opacities: (N,) that decide who is faint. A model that predicts opacities gives the
            greatest over sampled frames.
        settings: Thresholds and the cap.
        contribution: (N,) pixels, the greatest over sampled pictures; None keeps the hidden.

    Returns:
        The plan; the same for the same arguments.
    """
    size = scales.detach().amax(-1)  # (N,)
    gradient = stats.mean_gradient()
    wanted = gradient > settings.gradient_threshold
    large = size > settings.clone_below
    final_size = torch.where(wanted & large, size / SPLIT_SHRINK, size)
    faint = opacities.detach() < settings.prune_opacity
    dead = faint | (final_size > settings.prune_scale)
    if contribution is not None:
        dead |= contribution < settings.prune_contribution * contribution.median()
    alive = under_cap(~dead, opacities.detach(), settings.max_gaussians)
    room = min(settings.max_gaussians - int(alive.sum()), int(settings.growth * len(size)))
    grown = _strongest(wanted & alive, gradient, room)
    return Plan(
        (alive & ~(grown & large)).nonzero()[:, 0],
        (grown & ~large).nonzero()[:, 0],
        (grown & large).nonzero()[:, 0].repeat_interleave(SPLIT_PARTS),
    )


def _strongest(chosen: Tensor, strength: Tensor, count: int) -> Tensor:
    """Mask (N,) of at most `count` of the chosen, the strongest; equals by their index."""
    order = strength.masked_fill(~chosen, -1).argsort(descending=True, stable=True)
    first = order[: min(count, int(chosen.sum()))]
    return torch.zeros_like(chosen).index_fill(0, first, True)


def under_cap(alive: Tensor, opacities: Tensor, cap: int) -> Tensor:
    """Mask (N,) of those alive, without the faintest where they are more than the cap."""
    return _strongest(alive, opacities, cap) if int(alive.sum()) > cap else alive


def reset_opacity_logits(logits: Tensor, ceiling: float = 0.01) -> Tensor:
    """Stored opacity logits (N,), none above that of `ceiling` (3DGS's opacity reset)."""
    return logits.detach().clamp_max(log(ceiling / (1 - ceiling)))
