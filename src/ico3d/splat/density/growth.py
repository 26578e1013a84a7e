"""The rules of 3D Gaussian Splatting by which Gaussians are cloned, split and removed."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import torch
from torch import Tensor

from ico3d.common.camera import Camera
from ico3d.splat.density.plan import SPLIT_SHRINK, Plan
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from ico3d.splat.rendering import RenderInfo

SPLIT_PARTS = 2
"""Number of Gaussians that a split one is replaced by."""


@dataclass(frozen=True)
class DensitySettings:
    """Thresholds by which Gaussians multiply and are removed.

    Attributes:
        max_gaussians: Upper limit on the number of Gaussians; those with the strongest gradients
            multiply first.
        gradient_threshold: Mean screen gradient (normalised device units) above which a Gaussian
            multiplies.
        clone_below: Of the Gaussians that multiply, those whose largest scale is at most this
            (metres) are cloned and the others split. 3DGS: 1 % of the scene's extent.
        prune_opacity: Gaussians with an opacity below this are removed.
        prune_scale: Gaussians whose largest scale exceeds this (metres) are removed. 3DGS: 10 % of
            the scene's extent.
        prune_contribution: Gaussians are removed whose contribution to pictures is below this, as a
            factor of the median contribution.
        growth: Largest share of the Gaussians that multiplies at once.
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
    """Screen-space gradients, gathered between two changes of the set of Gaussians.

    Attributes:
        gradient_sum: (N,) sum of a Gaussian's gradient lengths over the views that saw the
            Gaussian.
        views: (N,) number of views that saw the Gaussian.
    """

    gradient_sum: Tensor
    views: Tensor

    def __post_init__(self):
        """Checks the shapes, which may come from a checkpoint.

        Raises:
            ValueError: If they differ.
        """
        if self.views.dim() != 1 or self.gradient_sum.shape != self.views.shape:
            raise ValueError("gradients and views of Gaussians differ in number")

    @staticmethod
    def zeros(count: int, device: torch.device | str = "cpu") -> "DensityStats":
        """Empty statistics for `count` Gaussians."""
        return DensityStats(torch.zeros(count, device=device), torch.zeros(count, device=device))

    def add(self, info: RenderInfo) -> None:
        """Adds the gradients of one rendering; call after `backward`.

        A loss that averages over C cameras makes gradients C times smaller. They are multiplied by
        C here, so that the threshold means the same for any number of cameras.

        Raises:
            RuntimeError: If `backward` has not run.
        """
        visible = info.visible  # (C, N)
        norms = info.screen_gradients() * len(visible)  # (C, N)
        self.gradient_sum += (norms * visible).sum(0)
        self.views += visible.sum(0)

    def mean_gradient(self) -> Tensor:
        """(N,) mean gradient length over the views that saw the Gaussian; 0 without views."""
        return self.gradient_sum / self.views.clamp_min(1)


def contributions(gaussians: Gaussians, cameras: Sequence[Camera]) -> Tensor:
    """Contribution of each Gaussian to each picture: (C, N) blending weights, summed over pixels.

    Gaussians that are hidden by others, or too small for a pixel, contribute next to nothing, even
    if opaque.
    """
    gaussians = gaussians.detach()
    one = gaussians.means.new_zeros(len(gaussians), 3).requires_grad_()
    given: list[Tensor] = []
    for camera in cameras:
        colored = gaussians.painted(one)
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
    """Decides which Gaussians multiply and which are removed (3DGS section 5).

    Removed are Gaussians that are faint, hidden, or too large even after a split; only the others
    multiply. If the limit leaves no room for all, those with the strongest gradients multiply. If
    even the remaining Gaussians exceed the limit, the faintest are removed.

    Args:
        stats: Gradients gathered since the last plan.
        scales: (N, 3) activated, metres.
        opacities: (N,) opacities by which faint Gaussians are found. Models that predict opacities
            pass the maximum over sampled frames.
        settings: Thresholds and the limit on the number of Gaussians.
        contribution: (N,) maximum of `contributions` over sampled pictures; None skips this test.

    Returns:
        The plan; equal arguments give equal plans.
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
    """Mask (N,) of `alive`, without the faintest Gaussians if more than `cap` are alive."""
    return _strongest(alive, opacities, cap) if int(alive.sum()) > cap else alive


def reset_opacity_logits(logits: Tensor, ceiling: float = 0.01) -> Tensor:
    """Limits opacity logits (N,) to the logit of `ceiling` (the opacity reset of 3DGS)."""
    return logits.detach().clamp_max(log(ceiling / (1 - ceiling)))
