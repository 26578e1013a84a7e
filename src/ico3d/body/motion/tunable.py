"""The tunable MLP: each Gaussian mixes sets of weights in its own proportions (paper, eq. of y).

All layers are tunable, the last one too, where ψ is the identity: in the paper the MLP as a whole
has M sets of weights.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from ico3d.body.motion import tunable_kernels as kernels
from ico3d.body.motion.tunable_kernels import BLOCK, padded
from ico3d.errors import SettingsError
from ico3d.splat.cpu.compile import PARTS

MOST = 1024
"""Largest number of inputs, layers, values of a layer, and sets of weights."""
OUTPUT_GAIN = 0.1
"""Factor of the last layer's initial weights, so that Gaussians hardly move at first."""


@dataclass(frozen=True)
class MlpShape:
    """Sizes of a tunable MLP.

    Attributes:
        inputs: Number of input values.
        width: Number of values of each hidden layer.
        depth: Number of hidden layers, without the output layer.
        outputs: Number of output values: 3 of Δμ, 4 of Δr and 3 of Δs.
        sets: Number M of sets of weights.
    """

    inputs: int
    width: int = 64
    depth: int = 2
    outputs: int = 10
    sets: int = 2

    def __post_init__(self):
        """Checks the sizes.

        Raises:
            SettingsError: If a size is below 1 or above `MOST`.
        """
        sizes = (self.inputs, self.width, self.depth, self.outputs, self.sets)
        if min(sizes) < 1 or max(sizes) > MOST:
            raise SettingsError(f"Every size of a tunable MLP must be 1 to {MOST:,}: {self}.")

    @property
    def layers(self) -> list[tuple[int, int]]:
        """Numbers of inputs and of outputs of each layer, the output layer last."""
        sizes = [self.inputs, *[self.width] * self.depth, self.outputs]
        return list(pairwise(sizes))

    @property
    def weights(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of the tensors, layer by layer."""
        sizes = {}
        for layer, (inputs, outputs) in enumerate(self.layers):
            sizes[f"weight{layer}"] = (self.sets, inputs, outputs)
            sizes[f"bias{layer}"] = (self.sets, outputs)
        return sizes


def initial_weights(shape: MlpShape, generator: torch.Generator) -> dict[str, Tensor]:
    """Random weights, distributed as those of torch's linear layers, the last layer scaled down.

    Args:
        shape: Sizes of the MLP.
        generator: Draws the weights.

    Returns:
        For layer k of I inputs and O outputs: "weight{k}" (sets, I, O) and "bias{k}" (sets, O).
    """
    weights = {name: torch.empty(size) for name, size in shape.weights.items()}
    for layer, (inputs, _) in enumerate(shape.layers):
        bound = (OUTPUT_GAIN if layer == shape.depth else 1.0) / math.sqrt(inputs)
        for name in (f"weight{layer}", f"bias{layer}"):
            weights[name].uniform_(-bound, bound, generator=generator)
    return weights


def tunable_mlp(weights: dict[str, Tensor], shape: MlpShape, x: Tensor, alpha: Tensor) -> Tensor:
    """Applies layers y = ψ(Σ_m α_m (w_mᵀx + b_m)); ψ is ReLU, and the identity in the last layer.

    Args:
        weights: Tensors in the layout of `initial_weights`.
        shape: Sizes of the MLP.
        x: (N, inputs).
        alpha: (N, sets) factors α_m of each Gaussian, any numbers.

    Returns:
        (N, outputs), differentiable in weights, x and alpha.

    Raises:
        ValueError: If weights, x or alpha do not have these sizes.
    """
    tensors = [weights[name] for name in shape.weights]
    if [tensor.shape for tensor in tensors] != list(shape.weights.values()):
        raise ValueError(f"the weights must be {shape.weights}")
    if x.shape != (len(alpha), shape.inputs) or alpha.shape != (len(x), shape.sets):
        raise ValueError(f"x and alpha must be (N, {shape.inputs}) and (N, {shape.sets})")
    if all(_has_kernel(tensor) for tensor in (x, alpha, *tensors)):
        return _Mlp.apply(shape, x, alpha, *tensors)  # type: ignore[no-any-return]
    for layer in range(shape.depth + 1):
        blended = (alpha[:, :, None] * x[:, None]).flatten(1)  # (N, M·I)
        joined = torch.cat([blended, alpha], 1)  # (N, M·I + M)
        x = joined @ _joined(*tensors[2 * layer : 2 * layer + 2])  # (N, O)
        x = x if layer == shape.depth else torch.relu(x)
    return x


def _has_kernel(tensor: Tensor) -> bool:
    return tensor.device.type == "cpu" and tensor.dtype == torch.float32


def _joined(weight: Tensor, bias: Tensor) -> Tensor:
    """(M·I + M, O) matrix of a layer for inputs α_1·x, …, α_M·x, α_1, …, α_M."""
    return torch.cat([weight.flatten(0, 1), bias])


class _Mlp(torch.autograd.Function):
    """The numba kernels as a differentiable function; threads do not change its results."""

    @staticmethod
    def forward(ctx, shape: MlpShape, x: Tensor, alpha: Tensor, *tensors: Tensor) -> Tensor:
        x, alpha = x.contiguous(), alpha.contiguous()
        matrices = _padded_matrices(tensors)
        layers = _layer_table(shape)
        blocks = -(-len(x) // BLOCK)
        hidden = x.new_empty(blocks, shape.depth, padded(shape.width) * BLOCK)
        out = x.new_empty(len(x), shape.outputs)
        flat = torch.cat([matrix.flatten() for matrix in matrices])
        kernels.forward(*_arrays(x, alpha, flat, layers, hidden, out))
        ctx.save_for_backward(x, alpha, hidden)
        ctx.shape, ctx.layers, ctx.matrices = shape, layers, matrices
        return out

    @staticmethod
    def backward(ctx, *gradients: Tensor):
        x, alpha, hidden = ctx.saved_tensors
        flat = torch.cat([matrix.T.flatten() for matrix in ctx.matrices])
        g_x, g_alpha = torch.empty_like(x), torch.empty_like(alpha)
        g_weights = x.new_zeros(PARTS, len(flat))
        taken = (x, alpha, flat, ctx.layers, hidden, gradients[0].contiguous())
        kernels.backward(*_arrays(*taken, g_x, g_alpha, g_weights))
        return None, g_x, g_alpha, *_taken_apart(ctx.shape, ctx.matrices, g_weights.sum(0))


def _padded_matrices(tensors: tuple[Tensor, ...]) -> list[Tensor]:
    """The matrix of each layer, with zeros appended up to multiples of four rows and columns."""
    matrices = []
    for weight, bias in zip(tensors[::2], tensors[1::2], strict=True):
        matrix = _joined(weight, bias)
        rows, columns = matrix.shape
        zeros = (0, padded(columns) - columns, 0, padded(rows) - rows)
        matrices.append(torch.nn.functional.pad(matrix, zeros))
    return matrices


def _layer_table(shape: MlpShape) -> Tensor:
    """(layers, 4) for the kernels: first weight, inputs, padded rows and padded columns."""
    table, first = [], 0
    for inputs, outputs in shape.layers:
        rows, columns = padded(shape.sets * (inputs + 1)), padded(outputs)
        table.append((first, inputs, rows, columns))
        first += rows * columns
    return torch.tensor(table)


def _taken_apart(shape: MlpShape, matrices: list[Tensor], flat: Tensor) -> list[Tensor]:
    """Weights and biases of each layer from the padded matrices, flattened one after the other."""
    parts = []
    pieces = flat.split([matrix.numel() for matrix in matrices])
    for (inputs, outputs), matrix, piece in zip(shape.layers, matrices, pieces, strict=True):
        values = piece.view_as(matrix)[:, :outputs]
        weight, bias = values[: shape.sets * (inputs + 1)].split((shape.sets * inputs, shape.sets))
        parts += [weight.reshape(shape.sets, inputs, outputs), bias.contiguous()]
    return parts


def _arrays(*tensors: Tensor) -> list[np.ndarray]:
    return [tensor.detach().numpy() for tensor in tensors]


def positional_encoding(x: Tensor, bands: int) -> Tensor:
    """γ(x): the values, and sines and cosines of the values times π, 2·π, 4·π, ….

    Args:
        x: (N, D), about −1 … 1.
        bands: Number of octaves.

    Returns:
        (N, D·(1 + 2·bands)): x, then all sines by octave, then all cosines by octave.
    """
    octaves = math.pi * 2.0 ** torch.arange(bands).to(x)  # (bands,)
    angles = (x[:, None] * octaves[:, None]).flatten(1)  # (N, bands·D)
    return torch.cat([x, angles.sin(), angles.cos()], 1)
