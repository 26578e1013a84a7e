"""The head's MLP φ on the CPU as one differentiable step: positions and features to values.

Torch's own operations, which `HeadModel.hidden` and `HeadModel.branches` consist of, pass over the
MLP's inputs and activations some twenty times; here each is written and read once.
"""

import math
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ico3d.head.blending import decoder_kernels as kernels
from ico3d.splat.cpu.compile import PARTS

LINE = 16
"""Widths of matrices are rounded up to multiples of this, a cache line of float32."""


def octave_rates(octaves: int) -> Tensor:
    """(L,) float64 angles per position of the position encoding, by octave."""
    return math.pi * 2.0 ** torch.arange(octaves, dtype=torch.float64)


def has_kernel(*tensors: Tensor) -> bool:
    """Whether `decode` takes these tensors: float32, on the CPU, and not for torch.compile."""
    fits = all(t.device.type == "cpu" and t.dtype == torch.float32 for t in tensors)
    return fits and not torch.compiler.is_compiling()


def decode(
    features: Tensor,
    positions: Tensor,
    octaves: int,
    first: tuple[Tensor, Tensor],
    last: tuple[Tensor, Tensor],
) -> Tensor:
    """Two layers over features and encoded positions, with a leaky ReLU between them.

    Args:
        features: (N, w) float32, as all tensors here.
        positions: (N, 3) in the head's box.
        octaves: L, octaves of the position encoding.
        first: Weight (H, w + 3 + 6·L) and bias (H,) of the first layer.
        last: Weight (V, H) and bias (V,) of the last layer.

    Returns:
        (N, V), differentiable in all tensors.
    """
    return _Decode.apply(features, positions, octaves, *first, *last)  # type: ignore[no-any-return]


class _Decode(torch.autograd.Function):
    """The kernels, and torch's matrix products for the first layer."""

    @staticmethod
    def forward(
        ctx: Any,
        features: Tensor,
        positions: Tensor,
        octaves: int,
        weight: Tensor,
        bias: Tensor,
        last_weight: Tensor,
        last_bias: Tensor,
    ) -> Tensor:
        count, width = features.shape
        angles = math.pi * positions  # (N, 3)
        beyond = -weight.shape[1] % LINE
        weight = torch.nn.functional.pad(weight.detach(), (0, beyond))  # (H, I)
        inputs = features.new_empty(count, weight.shape[1])  # (N, I)
        read = (features.contiguous(), positions.contiguous(), angles.sin(), angles.cos())
        values_of, places, sines, cosines, out = _arrays(*read, inputs)
        kernels.gather(values_of, places, sines, cosines, octaves, out)
        hidden = torch.addmm(bias, inputs, weight.T)  # (N, H)
        values = features.new_empty(count, len(last_bias))  # (N, V)
        last_weight = last_weight.contiguous()
        kernels.activate(*_arrays(hidden, last_weight, last_bias.contiguous(), values))
        ctx.save_for_backward(inputs, hidden, weight, last_weight)
        ctx.sizes = width, octaves, weight.shape[1] - beyond
        return values

    @staticmethod
    @once_differentiable
    # type: ignore (torch's own takes any number of gradients)
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        inputs, hidden, weight, last_weight = ctx.saved_tensors
        width, octaves, used = ctx.sizes
        by_features, by_positions, _, by_weights = ctx.needs_input_grad[:4]
        outputs, size = last_weight.shape
        g_hidden = torch.empty_like(hidden)
        parts = hidden.new_zeros(PARTS, outputs + 1, size + 1)
        taken = (hidden, last_weight, gradient.contiguous(), g_hidden, parts)
        kernels.activate_backward(*_arrays(*taken))
        g_features = g_positions = g_weight = None
        if by_features or by_positions:
            g_inputs = g_hidden @ weight  # (N, I)
            g_features = inputs.new_empty(len(inputs), width)
            g_positions = inputs.new_empty(len(inputs), 3)
            rates = octave_rates(octaves).to(inputs)
            kernels.scatter(*_arrays(g_inputs, inputs, rates, g_features, g_positions))
        if by_weights:
            g_weight = (g_hidden.T @ inputs)[:, :used]  # (H, w + 3 + 6·L)
        sums = parts.sum(0)  # (V + 1, H + 1)
        own, beside = sums[:, :size], sums[:outputs, size]
        return g_features, g_positions, None, g_weight, own[outputs], own[:outputs], beside


def _arrays(*tensors: Tensor) -> list:
    return [tensor.detach().numpy() for tensor in tensors]
