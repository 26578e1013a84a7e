"""Bodies in motion: the Gaussians of one window, and what moves them."""

from collections.abc import Mapping
from typing import Protocol

import torch
from torch import Tensor

from ico3d.splat.gaussians import Gaussians

CANONICAL = ("means", "quats", "log_scales", "opacity_logits", "color_logits")
"""What every Gaussian has, as training stores it."""


class Motion(Protocol):
    """How Gaussians get from their canonical state to a time τ in [0, 1] of their window.

    A motion holds no tensors: per-Gaussian ones follow density control, and all of them are
    trained, saved and frozen by name.
    """

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """Names of the tensors (N, …) that it hangs on the Gaussians."""
        ...

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of the tensors that all Gaussians share."""
        ...

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """Activated Gaussians.

        Args:
            values: `CANONICAL` and the motion's own tensors.
            tau: Time in the window, 0 to 1.
        """
        ...

    def about(self) -> dict:
        """What `ico3d.body.opening.motion_from` makes it again from, JSON-serialisable."""
        ...


class WindowModel:
    """The Gaussians of one window.

    Attributes:
        motion: What moves the Gaussians.
        gaussians: Per-Gaussian tensors by name, as stored: `means` (N, 3) metres, `quats` (N, 4)
            wxyz not normalised, `log_scales` (N, 3), `opacity_logits` (N,), `color_logits` (N, 3),
            and the motion's. Density control replaces them.
        shared: The motion's other tensors.
    """

    def __init__(self, motion: Motion, gaussians: dict[str, Tensor], shared: dict[str, Tensor]):
        """Takes tensors of these names.

        Raises:
            ValueError: If names or lengths do not fit one another.
        """
        for kind, tensors, names in (
            ("per-Gaussian", gaussians, {*CANONICAL, *motion.per_gaussian}),
            ("shared", shared, {*motion.shared}),
        ):
            if set(tensors) != names:
                raise ValueError(f"{kind} tensors are {sorted(tensors)}, expected {sorted(names)}")
        if len({len(tensor) for tensor in gaussians.values()}) != 1:
            raise ValueError("per-Gaussian tensors differ in length")
        self.motion, self.gaussians, self.shared = motion, gaussians, shared

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self.gaussians["means"])

    @property
    def device(self) -> torch.device:
        """Where its tensors lie."""
        return self.gaussians["means"].device

    def to(self, device: torch.device) -> None:
        """Moves the tensors."""
        self.gaussians = {name: value.to(device) for name, value in self.gaussians.items()}
        self.shared = {name: value.to(device) for name, value in self.shared.items()}

    def at(self, tau: float) -> Gaussians:
        """Activated Gaussians in the world at a time τ in [0, 1] of the window."""
        return self.motion.at({**self.gaussians, **self.shared}, tau)

    def canonical(self) -> Gaussians:
        """Activated Gaussians as they are before anything moves them."""
        return activated(self.gaussians)


def activated(
    values: Mapping[str, Tensor],
    means: Tensor | None = None,
    quats: Tensor | None = None,
    log_scales: Tensor | None = None,
    visibility: Tensor | None = None,
) -> Gaussians:
    """Renderable Gaussians from stored tensors.

    Args:
        values: `CANONICAL`.
        means: (N, 3) in the place of the stored ones.
        quats: (N, 4) in the place of the stored ones.
        log_scales: (N, 3) in the place of the stored ones.
        visibility: (N,) factors of the opacities.
    """
    opacities = values["opacity_logits"].sigmoid()  # (N,)
    return Gaussians(
        means=values["means"] if means is None else means,
        quats=values["quats"] if quats is None else quats,
        scales=(values["log_scales"] if log_scales is None else log_scales).exp(),
        opacities=opacities if visibility is None else opacities * visibility,
        colors=values["color_logits"].sigmoid(),
    )
