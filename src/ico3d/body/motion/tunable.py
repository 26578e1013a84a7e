"""The tunable MLP: sets of weights that each Gaussian blends its own way (paper, eq. of y).

All layers are tunable, the last one too (there ψ is the identity): the paper's MLP as a whole
consists of M sets.
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

    @property
    def weights(self) -> dict[str, tuple[int, ...]]:
        """Names and sizes of the tensors, layer by layer."""
        sizes = {}
        for layer, (inputs, outputs) in enumerate(self.layers):
            sizes[f"weight{layer}"] = (self.sets, inputs, outputs)
            sizes[f"bias{layer}"] = (self.sets, outputs)
        return sizes


def initial_weights(shape: MlpShape, generator: torch.Generator) -> dict[str, Tensor]:
    """Random weights: those of a linear layer in torch, each set its own.

    Args:
        shape: Sizes.
        generator: Draws the weights.

    Returns:
        Per layer k of I inputs and O outputs: "weight{k}" (sets, I, O) and "bias{k}" (sets, O).
    """
    weights = {name: torch.empty(size) for name, size in shape.weights.items()}
    for layer, (inputs, _) in enumerate(shape.layers):
        bound = (OUTPUT_GAIN if layer == shape.depth else 1.0) / math.sqrt(inputs)
        for name in (f"weight{layer}", f"bias{layer}"):
            weights[name].uniform_(-bound, bound, generator=generator)
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

    Raises:
        ValueError: If weights, x or alpha are of other sizes.
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
        x = joined @ _joined(*tensors[2 * layer : 2 * layer + 2])
        x = x if layer == shape.depth else torch.relu(x)
    return x


def _has_kernel(tensor: Tensor) -> bool:
    return tensor.device.type == "cpu" and tensor.dtype == torch.float32


def _joined(weight: Tensor, bias: Tensor) -> Tensor:
    """(M·I + M, O): the matrix of a layer, whose inputs are each α times x, then the α."""
    return torch.cat([weight.flatten(0, 1), bias])


class _Mlp(torch.autograd.Function):
    """The kernels as a differentiable function; results do not depend on the number of threads."""

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
    """Each layer's matrix with zeros where rows or columns are no whole fours."""
    matrices = []
    for weight, bias in zip(tensors[::2], tensors[1::2], strict=True):
        matrix = _joined(weight, bias)
        rows, columns = matrix.shape
        zeros = (0, padded(columns) - columns, 0, padded(rows) - rows)
        matrices.append(torch.nn.functional.pad(matrix, zeros))
    return matrices


def _layer_table(shape: MlpShape) -> Tensor:
    """(layers, 4) what the kernels want to know of each layer."""
    table, first = [], 0
    for inputs, outputs in shape.layers:
        rows, columns = padded(shape.sets * (inputs + 1)), padded(outputs)
        table.append((first, inputs, rows, columns))
        first += rows * columns
    return torch.tensor(table)


def _taken_apart(shape: MlpShape, matrices: list[Tensor], flat: Tensor) -> list[Tensor]:
    """Weights and biases of each layer out of the padded matrices."""
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
