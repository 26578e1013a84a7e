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
from ico3d.errors import SettingsError
from ico3d.splat.gaussians import Gaussians

POSITIONS, DELTAS = 4, 10
"""Number of values that the positional encoding takes (x, y, z and time), and of the MLP's."""
GRID, MLP = "grid.", "mlp."
"""Prefixes of the names of shared tensors: planes of the encoder, and weights of the MLP."""


@dataclass(frozen=True)
class Deformation:
    """A `Motion` by a tunable MLP: Δμ, Δr, Δs = φ_dyn(f_v, α).

    The features f_v come from the space-time encoder, or from the positional encodings γ(μ) and
    γ(t). The differences are added to stored means, rotations and log scales, before activation.

    Attributes:
        middle: (3,) centre of the box that holds the window's motion, metres.
        half: (3,) half the edges of that box, metres.
        mlp: Shape of the tunable MLP.
        encoder: Shape of the space-time encoder; None for the positional encoding.
        bands: Octaves of the positional encoding.
    """

    middle: tuple[float, float, float]
    half: tuple[float, float, float]
    mlp: MlpShape
    encoder: EncoderShape | None
    bands: int

    def __post_init__(self):
        """Checks that encoding, MLP and what is moved fit one another.

        Raises:
            SettingsError: If they do not.
        """
        encoded = POSITIONS * (1 + 2 * self.bands)
        inputs = encoded if self.encoder is None else self.encoder.outputs
        if (self.mlp.inputs, self.mlp.outputs) != (inputs, DELTAS):
            raise SettingsError(f"An MLP of {self.mlp} does not take {inputs} to {DELTAS} values.")

    @property
    def per_gaussian(self) -> tuple[str, ...]:
        """`alpha` (N, M), shares of the M sets of weights, if there is more than one set."""
        return ("alpha",) if self.mlp.sets > 1 else ()

    @property
    def shared(self) -> tuple[str, ...]:
        """Weights of the MLP and planes of the encoder, by their prefixed names."""
        layers = range(self.mlp.depth + 1)
        names = [f"{MLP}{kind}{layer}" for layer in layers for kind in ("weight", "bias")]
        scales = () if self.encoder is None else range(len(self.encoder.space))
        planes = (*SPACE_PLANES, *TIME_PLANES)
        return (*names, *(f"{GRID}{plane}{scale}" for scale in scales for plane in planes))

    def initial(self, generator: torch.Generator) -> dict[str, Tensor]:
        """Random shared tensors, with which Gaussians hardly move."""
        tensors = {MLP + n: value for n, value in initial_weights(self.mlp, generator).items()}
        if self.encoder is not None:
            planes = initial_planes(self.encoder, generator)
            tensors |= {GRID + name: value for name, value in planes.items()}
        return tensors

    def at(self, values: Mapping[str, Tensor], tau: float) -> Gaussians:
        """Activated Gaussians in the world at τ in [0, 1] of the window."""
        delta = self.deltas(values, tau)  # (N, 10)
        return activated(
            values,
            values["means"] + delta[:, :3],
            values["quats"] + delta[:, 3:7],
            values["log_scales"] + delta[:, 7:],
        )

    def deltas(self, values: Mapping[str, Tensor], tau: float) -> Tensor:
        """(N, 10): Δμ (3) in metres, Δr (4), Δs (3) at τ (paper, equation of φ_dyn)."""
        means = values["means"]
        alpha = values["alpha"] if self.mlp.sets > 1 else means.new_ones(len(means), 1)
        features = self._features(values, tau)  # (N, inputs)
        return tunable_mlp(_below(MLP, values), self.mlp, features, alpha)

    def _features(self, values: Mapping[str, Tensor], tau: float) -> Tensor:
        """(N, mlp.inputs) features that the MLP reads."""
        means = values["means"]
        middle, half = means.new_tensor(self.middle), means.new_tensor(self.half)  # (3,) each
        inside = (means - middle) / half  # (N, 3) in [−1, 1]
        if self.encoder is not None:
            return encode(_below(GRID, values), self.encoder, inside, tau)
        times = means.new_full((len(means), 1), tau)
        return positional_encoding(torch.cat([inside, times], 1), self.bands)  # (N, inputs)

    @torch.no_grad()
    def continue_time(self, shared: Mapping[str, Tensor], row: int, neighbour: int) -> None:
        """Gives one node of time the encoder's features of another; nothing without an encoder.

        Args:
            shared: The shared tensors by name, which are changed in place.
            row: The node of time.
            neighbour: The node whose features it takes over.
        """
        scales = () if self.encoder is None else range(len(self.encoder.space))
        for scale in scales:
            for plane in TIME_PLANES:
                values = shared[f"{GRID}{plane}{scale}"]  # (T, S, C)
                values[row] = values[neighbour]

    def about(self) -> dict:
        """Kind and fields of this motion, for `motion_from`."""
        return {"kind": "deformation", **asdict(self)}


def _below(prefix: str, values: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Tensors whose names begin with a prefix, by their names without it."""
    return {n.removeprefix(prefix): value for n, value in values.items() if n.startswith(prefix)}
