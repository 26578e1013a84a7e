"""Plans for a change of the set of Gaussians, applied to everything stored per Gaussian."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from ico3d.splat import quaternions

SPLIT_SHRINK = 1.6
"""Factor by which the parts of a split Gaussian are smaller than the original."""


@dataclass(frozen=True)
class Plan:
    """A change of a set of N Gaussians to M: the kept ones, then clones, then parts of split ones.

    Attributes:
        keep: (K,) indices of Gaussians that stay as they are.
        clone_from: (A,) indices of Gaussians of which a copy is added.
        split_from: (2·B,) indices of split Gaussians, each twice; the originals are not kept.
    """

    keep: Tensor
    clone_from: Tensor
    split_from: Tensor

    def __len__(self) -> int:
        """How many Gaussians there are afterwards."""
        return len(self.keep) + len(self.clone_from) + len(self.split_from)

    @property
    def sources(self) -> Tensor:
        """(M,) index of the old Gaussian from which each new Gaussian comes."""
        return torch.cat([self.keep, self.clone_from, self.split_from])


def growth_plan(now: int, wanted: int, generator: torch.Generator) -> Plan:
    """A plan that splits random Gaussians, each at most once, so that there are `wanted` or fewer.

    Args:
        now: Number of Gaussians before.
        wanted: Number of Gaussians after, if at most twice as many.
        generator: Random generator on the CPU.
    """
    order = torch.randperm(now, generator=generator)
    count = max(min(wanted - now, now), 0)
    split, keep = order[:count], order[count:].sort().values
    return Plan(keep, order[:0], split.repeat(2))


def apply_plan(values: Tensor, plan: Plan, axis: int = 0) -> Tensor:
    """Applies a plan to values stored per Gaussian; clones and parts copy the original's values.

    Args:
        values: Tensor of size N along `axis`.
        plan: The plan.
        axis: The axis of the Gaussians.

    Returns:
        Tensor of size M along `axis`, without gradient.
    """
    return values.detach().index_select(axis, plan.sources.to(values.device))


def apply_plan_to_state(state: Tensor, plan: Plan, axis: int = 0) -> Tensor:
    """Applies a plan to an optimiser's running values; clones and parts start with 0."""
    new = apply_plan(state, plan, axis)
    new.narrow(axis, len(plan.keep), len(plan) - len(plan.keep)).zero_()
    return new


def apply_plan_to_geometry(
    means: Tensor, quats: Tensor, scales: Tensor, plan: Plan, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Applies a plan to means and scales; parts of a split are sampled from the original Gaussian.

    Args:
        means: (N, 3) metres.
        quats: (N, 4) wxyz; need not be normalised.
        scales: (N, 3) activated, metres.
        plan: The plan.
        generator: Random generator on the CPU, for the positions of the parts.

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
    """Everything that density control changes of a model; both mappings are changed in place.

    Attributes:
        parameters: Parameters per Gaussian in the form that is trained: `means` (N, 3), `quats` (N,
            4) and `log_scales` (N, 3), for strategies also `opacity_logits` (N,), and any others of
            the model (HeadGaS++: the basis F).
        moments: Running values of the optimiser. Those of parameter NAME are NAME.first and
            NAME.second (`training.optimiser.Optimiser.moments`), and NAME.mean where the training
            keeps a running mean of the parameter.
        axes: For parameters whose Gaussians do not lie along axis 0: their axis, by name.
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
        """Applies a plan to all parameters and moments.

        Args:
            plan: Which Gaussians are kept, cloned or split.
            generator: Random generator on the CPU, for the positions of the parts of split
                Gaussians.
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

    def grow(self, count: int, generator: torch.Generator) -> None:
        """Splits Gaussians at random until there are `count`.

        Args:
            count: Number of Gaussians that is wanted.
            generator: Random generator on the CPU.
        """
        while len(self) < count:
            self.carry_out(growth_plan(len(self), count, generator), generator)

    def replace(self, name: str, value: Tensor) -> None:
        """Replaces a parameter's value; the new tensor requires gradients if the old one did."""
        learns = self.parameters[name].requires_grad
        self.parameters[name] = value.detach().requires_grad_(learns)

    def forget(self, name: str, index: Tensor | slice = slice(None)) -> None:
        """Sets a parameter's moments to 0 for some Gaussians, which must lie along axis 0."""
        for moment in self._moments_of(name):
            self.moments[moment][index] = 0

    def axis(self, name: str) -> int:
        """The axis of a parameter along which the Gaussians lie."""
        return self.axes.get(name, 0)

    def _moments_of(self, name: str) -> list[str]:
        """Names of the running values that exist per Gaussian."""
        kinds = (f"{name}.first", f"{name}.second", f"{name}.mean")
        return [kind for kind in kinds if kind in self.moments]
