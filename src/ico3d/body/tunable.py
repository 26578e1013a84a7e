"""The tunable MLP: sets of weights that each Gaussian blends its own way (paper, eq. of y).

All layers are tunable, the last one too (there ψ is the identity): the paper's MLP as a whole
consists of M sets.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor

from ico3d.errors import SettingsError

OUTPUT_GAIN = 0.1
"""Factor of the last layer at the beginning, so that nothing moves far before it must."""


@dataclass(frozen=True)
class MlpShape:
    """What decides the sizes of the weights.

    Attributes:
        inputs: Values that enter.
        width: Values of each hidden layer.
        depth: Hidden layers; the output layer comes on top.
        outputs: Values that come out: Δμ 3, Δr 4, Δs 3.
        sets: M, sets of weights, the modes of motion.
    """

    inputs: int
    width: int = 64
    depth: int = 2
    outputs: int = 10
    sets: int = 2

    def __post_init__(self):
        """Raises SettingsError where a layer would be empty."""
        if min(self.inputs, self.width, self.depth, self.outputs, self.sets) < 1:
            raise SettingsError(f"Every size of a tunable MLP must be at least 1: {self}.")

    @property
    def layers(self) -> list[tuple[int, int]]:
        """Inputs and outputs of each layer, the output layer last."""
        sizes = [self.inputs, *[self.width] * self.depth, self.outputs]
        return list(pairwise(sizes))


def initial_weights(shape: MlpShape, generator: torch.Generator) -> dict[str, Tensor]:
    """Random weights: those of a linear layer in torch, each set its own.

    Args:
        shape: Sizes.
        generator: Of the numbers.

    Returns:
        Per layer k of I inputs and O outputs: "weight{k}" (sets, I, O) and "bias{k}" (sets, O).
    """
    weights = {}
    for layer, (inputs, outputs) in enumerate(shape.layers):
        bound = (OUTPUT_GAIN if layer == shape.depth else 1.0) / math.sqrt(inputs)
        for name, size in (("weight", (inputs, outputs)), ("bias", (outputs,))):
            values = torch.empty(shape.sets, *size)
            weights[f"{name}{layer}"] = values.uniform_(-bound, bound, generator=generator)
    return weights


def tunable_mlp(weights: dict[str, Tensor], shape: MlpShape, x: Tensor, alpha: Tensor) -> Tensor:
    """Layers y = ψ(Σ_m α_m (w_mᵀx + b_m)); ψ is ReLU, and the identity at the last.

    Args:
        weights: As `initial_weights` makes them.
        shape: Their sizes.
        x: (N, inputs).
        alpha: (N, sets) how much each Gaussian has of each set; any numbers.

    Returns:
        (N, outputs), differentiable in weights, x and alpha.
    """
    for layer in range(shape.depth + 1):
        x = _layer(x, alpha, weights[f"weight{layer}"], weights[f"bias{layer}"])
        x = x if layer == shape.depth else torch.relu(x)
    return x


def _layer(x: Tensor, alpha: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """(N, O): one matrix product of the inputs once per set, each times its α."""
    blended = (alpha[:, :, None] * x[:, None]).flatten(1)  # (N, M·I)
    return torch.cat([blended, alpha], 1) @ torch.cat([weight.flatten(0, 1), bias])


def positional_encoding(x: Tensor, bands: int) -> Tensor:
    """γ(x): the values with their sines and cosines at octaves of π.

    Args:
        x: (N, D), about −1 … 1.
        bands: Octaves.

    Returns:
        (N, D·(1 + 2·bands)): x, then sines, then cosines, each by octave.
    """
    octaves = math.pi * 2.0 ** torch.arange(bands).to(x)  # (bands,)
    angles = (x[:, None] * octaves[:, None]).flatten(1)  # (N, bands·D)
    return torch.cat([x, angles.sin(), angles.cos()], 1)
