"""Linear blend skinning of Gaussians: by numba kernels on the CPU, by torch on other devices."""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import embedding_bag

from ico3d.body.skinning import kernels
from ico3d.body.skinning.kinematics import left_matrices
from ico3d.splat.cpu.compile import PARTS


class Posed(NamedTuple):
    """Gaussians after skinning.

    Attributes:
        means: (N, 3) metres in the world.
        quats: (N, 4) wxyz, not normalised.
        normals: (N, 3) directions in which the surface faces, not normalised.
    """

    means: Tensor
    quats: Tensor
    normals: Tensor


def blended(
    table: Tensor, joints: Tensor, logits: Tensor, means: Tensor, quats: Tensor, normals: Tensor
) -> Posed:
    """Moves Gaussians with their joints.

    Means and normals are transformed by the blended matrices, rotations by the blended quaternions.

    Args:
        table: (J, 16) transforms of the joints, from `ico3d.body.skinning.kinematics.transforms`.
        joints: (N, 4) int32 indices of the joints that carry each Gaussian.
        logits: (N, 4), whose softmax gives the weights of these joints.
        means: (N, 3) at rest, metres.
        quats: (N, 4) wxyz at rest.
        normals: (N, 3) at rest; they get no gradient.
    """
    parts = (table, logits, means, quats, normals)
    if all(part.device.type == "cpu" and part.dtype == torch.float32 for part in parts):
        return Posed(*_Blend.apply(table, joints, logits, means, quats, normals.detach()))  # type: ignore[misc]
    weights = logits.softmax(1)  # (N, 4)
    mixed = embedding_bag(joints, table, mode="sum", per_sample_weights=weights)  # (N, 16)
    turned = mixed[:, :9].unflatten(1, (3, 3))  # (N, 3, 3)
    return Posed(
        _applied(turned, means) + mixed[:, 9:12],
        _applied(left_matrices(mixed[:, 12:]), quats),
        _applied(turned, normals.detach()),
    )


def _applied(matrices: Tensor, vectors: Tensor) -> Tensor:
    """(N, R) products of matrices (N, R, C) and vectors (N, C)."""
    return (matrices * vectors[:, None]).sum(2)


class _Blend(torch.autograd.Function):
    """The numba kernels as a differentiable function; threads do not change its results."""

    @staticmethod
    def forward(ctx, *tensors: Tensor):
        tensors = tuple(tensor.contiguous() for tensor in tensors)
        means, quats = tensors[3:5]
        out = torch.empty_like(means), torch.empty_like(quats), torch.empty_like(means)
        kernels.forward(*_arrays(*tensors, *out))
        ctx.save_for_backward(*tensors)
        return out

    @staticmethod
    def backward(ctx, *gradients: Tensor):
        tensors = ctx.saved_tensors
        table, _, logits, means, quats, _ = tensors
        g_table = table.new_zeros(PARTS, *table.shape)
        found = [torch.empty_like(tensor) for tensor in (logits, means, quats)]
        given = [gradient.contiguous() for gradient in gradients]
        kernels.backward(*_arrays(*tensors, *given, g_table, *found))
        return g_table.sum(0), None, *found, None


def _arrays(*tensors: Tensor) -> list[np.ndarray]:
    return [tensor.detach().numpy() for tensor in tensors]
