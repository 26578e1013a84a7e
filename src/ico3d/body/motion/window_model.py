"""The Gaussians of one window of a body, and the protocol of motions that move them."""

from collections.abc import Mapping
from typing import Protocol

import torch
from torch import Tensor

from ico3d.splat import harmonics
from ico3d.splat.gaussians import Gaussians

CANONICAL = ("means", "quats", "log_scales", "opacity_logits", "color_logits")
"""Names of the tensors that all Gaussians have, as they are trained and stored."""

HARMONICS = "harmonics"
"""Name of the tensor (N, K − 1, 3) that Gaussians also have if their colours depend on the view:
coefficients of spherical harmonics above degree 0, in the world."""


class Motion(Protocol):
    """How Gaussians get from their canonical state to a time τ in [0, 1] of their window.

    A motion itself holds no tensors, only their names: tensors are trained, saved and frozen by
    name, and density control changes those of the Gaussians.
    """

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """Names of the tensors (N, …) that Gaussians have for this motion."""
        ...

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of the tensors that all Gaussians share."""
        ...

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """Activated Gaussians in the world at a time.

        Args:
            values: The tensors of `CANONICAL` and of this motion, by name.
            tau: Time in the window, 0 to 1.
        """
        ...

    def about(self) -> dict:
        """JSON-serialisable description, from which `ico3d.body.opening.motion_from` remakes it."""
        ...


class WindowModel:
    """The Gaussians of one window, with their motion.

    Attributes:
        motion: What moves the Gaussians.
        gaussians: Tensors of the Gaussians by name, as stored: `means` (N, 3) metres, `quats`
            (N, 4) wxyz not normalised, `log_scales` (N, 3), `opacity_logits` (N,), `color_logits`
            (N, 3), those of `motion.per_gaussian`, and `HARMONICS` where colours depend on the
            view. Density control replaces them.
        shared: Tensors of `motion.shared` by name.
        camera_colors: (C, 3, 4) how the recording cameras' colours differ from those of the
            Gaussians, by index of the camera (`ico3d.body.camera_colors`); None where that was not
            learnt. Training alone uses it.
    """

    def __init__(
        self,
        motion: Motion,
        gaussians: dict[str, Tensor],
        shared: dict[str, Tensor],
        camera_colors: Tensor | None = None,
    ):
        """Makes a model of tensors, which are not copied.

        Raises:
            ValueError: If names are not those that the motion asks for, or tensors of the Gaussians
                differ in length.
        """
        for kind, tensors, names in (
            ("per-Gaussian", gaussians, {*CANONICAL, *motion.per_gaussian}),
            ("shared", shared, {*motion.shared}),
        ):
            if set(tensors) - {HARMONICS} != names:
                raise ValueError(f"{kind} tensors are {sorted(tensors)}, expected {sorted(names)}")
        if len({len(tensor) for tensor in gaussians.values()}) != 1:
            raise ValueError("per-Gaussian tensors differ in length")
        self.motion, self.gaussians, self.shared = motion, gaussians, shared
        self.camera_colors = camera_colors

    def __len__(self) -> int:
        """Number of Gaussians."""
        return len(self.gaussians["means"])

    @property
    def canonical_names(self) -> tuple[str, ...]:
        """Names of the tensors of the canonical Gaussians."""
        return (*CANONICAL, HARMONICS) if HARMONICS in self.gaussians else CANONICAL

    @property
    def device(self) -> torch.device:
        """Device of the tensors."""
        return self.gaussians["means"].device

    def to(self, device: torch.device) -> None:
        """Moves all tensors to a device."""
        self.gaussians = {name: value.to(device) for name, value in self.gaussians.items()}
        self.shared = {name: value.to(device) for name, value in self.shared.items()}
        if self.camera_colors is not None:
            self.camera_colors = self.camera_colors.to(device)

    def at(self, tau: float) -> Gaussians:
        """Activated Gaussians in the world at a time τ in [0, 1] of the window."""
        return self.motion.at({**self.gaussians, **self.shared}, tau)

    def canonical(self) -> Gaussians:
        """The canonical Gaussians, activated, without motion."""
        return activated(self.gaussians)


def activated(
    values: Mapping[str, Tensor],
    means: Tensor | None = None,
    quats: Tensor | None = None,
    log_scales: Tensor | None = None,
    visibility: Tensor | None = None,
) -> Gaussians:
    """Gaussians that can be rendered, from stored tensors.

    Args:
        values: The tensors of `CANONICAL` by name.
        means: (N, 3) instead of the stored means.
        quats: (N, 4) instead of the stored rotations.
        log_scales: (N, 3) instead of the stored log scales.
        visibility: (N,) factors of the opacities; None for 1.
    """
    opacities = values["opacity_logits"].sigmoid()  # (N,)
    colors, rest = values["color_logits"].sigmoid(), values.get(HARMONICS)
    return Gaussians(
        means=values["means"] if means is None else means,
        quats=values["quats"] if quats is None else quats,
        scales=(values["log_scales"] if log_scales is None else log_scales).exp(),
        opacities=opacities if visibility is None else opacities * visibility,
        colors=colors if rest is None else None,
        sh=None if rest is None else harmonics.of_colors(colors, rest),  # (N, K, 3)
    )
