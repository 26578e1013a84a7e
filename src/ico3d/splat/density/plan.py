"""What becomes of Gaussians, and everything per Gaussian that has to follow."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from ico3d.splat import quaternions

SPLIT_SHRINK = 1.6
"""A Gaussian that is split becomes parts smaller by this factor."""


@dataclass(frozen=True)
class Plan:
    """What becomes of N Gaussians; the new order is: kept, clones, parts of the split.

    Attributes:
        keep: (K,) indices of those that stay as they are.
        clone_from: (A,) indices of which there is one more.
        split_from: (2·B,) indices of the split, each twice: they do not stay.
    """

    keep: Tensor
    clone_from: Tensor
    split_from: Tensor

    def __len__(self) -> int:
        """How many Gaussians there are afterwards."""
        return len(self.keep) + len(self.clone_from) + len(self.split_from)

    @property
    def sources(self) -> Tensor:
        """(M,) the old index of each new Gaussian."""
        return torch.cat([self.keep, self.clone_from, self.split_from])


def apply_plan(values: Tensor, plan: Plan, axis: int = 0) -> Tensor:
    """Carries per-Gaussian values over: clones and parts copy their source's.

    Args:
        values: N long along `axis`.
        plan: The plan.
        axis: Along which the Gaussians lie.

    Returns:
        M long along `axis`, without gradient.
    """
    return values.detach().index_select(axis, plan.sources.to(values.device))


def apply_plan_to_state(state: Tensor, plan: Plan, axis: int = 0) -> Tensor:
    """Carries an optimiser's running values over; those of clones and parts begin at 0."""
    new = apply_plan(state, plan, axis)
    new.narrow(axis, len(plan.keep), len(plan) - len(plan.keep)).zero_()
    return new


def apply_plan_to_geometry(
    means: Tensor, quats: Tensor, scales: Tensor, plan: Plan, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Carries means and activated scales over; parts of the split are drawn from their source.

    Args:
        means: (N, 3).
        quats: (N, 4), need not be normalised.
        scales: (N, 3) activated, metres.
        plan: The plan.
        generator: On the CPU; decides where the parts lie.

    Returns:
        Means (M, 3) and scales (M, 3), without gradient.
    """
    new_means, new_scales = apply_plan(means, plan), apply_plan(scales, plan)
    parts = slice(len(plan) - len(plan.split_from), len(plan))
    noise = torch.randn(len(plan.split_from), 3, generator=generator).to(means)
    turns = quaternions.to_matrix(apply_plan(quats, plan)[parts])  # (2·B, 3, 3)
    offsets = turns @ (noise * new_scales[parts])[..., None]  # (2·B, 3, 1)
    new_means[parts] += offsets[..., 0]
    new_scales[parts] /= SPLIT_SHRINK
    return new_means, new_scales


@dataclass
class Population:
    """The Gaussians of a model as density control sees them; both mappings change in place.

    Attributes:
        parameters: What exists per Gaussian, as it is stored: `means` (N, 3), `quats` (N, 4) and
            `log_scales` (N, 3), for strategies also `opacity_logits` (N,), and whatever else a
            model hangs on its Gaussians (HeadGaS++: the basis F).
        moments: An optimiser's running values; what belongs to NAME is called NAME.first and
            NAME.second (`training.optimiser.Optimiser.moments`), and NAME.mean where a mean is
            kept of a model that nothing is added to any more.
        axes: Where the Gaussians of a parameter lie along another axis than the first.
    """

    parameters: dict[str, Tensor]
    moments: dict[str, Tensor]
    axes: Mapping[str, int] = field(default_factory=dict[str, int])

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self.parameters["means"])

    @property
    def scales(self) -> Tensor:
        """(N, 3) activated, metres."""
        return self.parameters["log_scales"].exp()

    @property
    def opacities(self) -> Tensor:
        """(N,) activated."""
        return self.parameters["opacity_logits"].sigmoid()

    def carry_out(self, plan: Plan, generator: torch.Generator) -> None:
        """Applies a plan to parameters and moments.

        Args:
            plan: Which Gaussians are kept, copied or split.
            generator: On the CPU; decides where the parts of split ones lie.
        """
        old = self.parameters
        means, scales = apply_plan_to_geometry(
            old["means"], old["quats"], self.scales, plan, generator
        )
        moved = {name: apply_plan(v, plan, self.axis(name)) for name, v in old.items()}
        moved |= {"means": means, "log_scales": scales.detach().log()}
        for name, value in moved.items():
            self.replace(name, value)
            for moment in self._moments_of(name):
                state = self.moments[moment]
                self.moments[moment] = apply_plan_to_state(state, plan, self.axis(name))

    def replace(self, name: str, value: Tensor) -> None:
        """Puts a value in the place of a parameter, which learns as the old one did."""
        learns = self.parameters[name].requires_grad
        self.parameters[name] = value.detach().requires_grad_(learns)

    def forget(self, name: str, index: Tensor | slice = slice(None)) -> None:
        """Sets the moments of some Gaussians' parameter to 0; the Gaussians lie along axis 0."""
        for moment in self._moments_of(name):
            self.moments[moment][index] = 0

    def axis(self, name: str) -> int:
        """Along which a parameter's Gaussians lie."""
        return self.axes.get(name, 0)

    def _moments_of(self, name: str) -> list[str]:
        """Names of the running values that exist per Gaussian."""
        kinds = (f"{name}.first", f"{name}.second", f"{name}.mean")
        return [kind for kind in kinds if kind in self.moments]
