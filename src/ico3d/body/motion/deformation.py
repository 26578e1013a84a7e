"""The learned deformation of SWinGS++, SWinGS and 4DGS (paper, dynamic 3D body Gaussians)."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import torch
from torch import Tensor

from ico3d.body.motion.encoder import (
    SPACE_PLANES,
    TIME_PLANES,
    EncoderShape,
    encode,
    initial_planes,
)
from ico3d.body.motion.tunable import MlpShape, initial_weights, positional_encoding, tunable_mlp
from ico3d.body.motion.window_model import activated
from ico3d.splat.gaussians import Gaussians

GRID, MLP = "grid.", "mlp."
"""What the names of the shared tensors begin with."""


@dataclass(frozen=True)
class Deformation:
    """A `Motion`: Δμ, Δr, Δs = φ_dyn(f_v, α), with f_v from the space-time encoder or γ(μ), γ(t).

    Differences are added to what is stored, before activation.

    Attributes:
        middle: (3,) of the box that holds the window's motion, metres.
        half: (3,) half its edges.
        mlp: Shape of the tunable MLP.
        encoder: Shape of the space-time encoder; None for the positional encoding.
        bands: Octaves of the positional encoding.
    """

    middle: tuple[float, float, float]
    half: tuple[float, float, float]
    mlp: MlpShape
    encoder: EncoderShape | None
    bands: int

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """`alpha` (N, M), where there is more than one set of weights."""
        return ("alpha",) if self.mlp.sets > 1 else ()

    @property
    def shared(self) -> tuple[str, ...]:
        """Weights of the MLP, and the planes."""
        layers = range(self.mlp.depth + 1)
        names = [f"{MLP}{kind}{layer}" for layer in layers for kind in ("weight", "bias")]
        scales = () if self.encoder is None else range(len(self.encoder.space))
        planes = (*SPACE_PLANES, *TIME_PLANES)
        return (*names, *(f"{GRID}{plane}{scale}" for scale in scales for plane in planes))

    def initial(self, generator: torch.Generator) -> dict[str, Tensor]:
        """The shared tensors at the beginning: next to nothing moves."""
        tensors = {MLP + n: value for n, value in initial_weights(self.mlp, generator).items()}
        if self.encoder is not None:
            planes = initial_planes(self.encoder, generator)
            tensors |= {GRID + name: value for name, value in planes.items()}
        return tensors

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """Activated Gaussians at τ."""
        delta = self.deltas(values, tau)  # (N, 10)
        return activated(
            values,
            values["means"] + delta[:, :3],
            values["quats"] + delta[:, 3:7],
            values["log_scales"] + delta[:, 7:],
        )

    def deltas(self, values: Mapping[str, Tensor], tau: float) -> Tensor:
        """(N, 10): Δμ in metres, Δr, Δs (paper eq. of φ_dyn)."""
        means = values["means"]
        alpha = values["alpha"] if self.mlp.sets > 1 else means.new_ones(len(means), 1)
        features = self._features(values, tau)  # (N, inputs)
        return tunable_mlp(_below(MLP, values), self.mlp, features, alpha)

    def _features(self, values: Mapping[str, Tensor], tau: float) -> Tensor:
        """(N, mlp.inputs) what the MLP sees."""
        means = values["means"]
        middle, half = means.new_tensor(self.middle), means.new_tensor(self.half)  # (3,) each
        inside = (means - middle) / half  # (N, 3) in [−1, 1]
        if self.encoder is not None:
            return encode(_below(GRID, values), self.encoder, inside, tau)
        times = means.new_full((len(means), 1), tau)
        return positional_encoding(torch.cat([inside, times], 1), self.bands)  # (N, inputs)

    def about(self) -> dict:
        """Its kind and fields."""
        return {"kind": "deformation", **asdict(self)}


def _below(prefix: str, values: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names begin with the prefix, without it."""
    return {n.removeprefix(prefix): value for n, value in values.items() if n.startswith(prefix)}
