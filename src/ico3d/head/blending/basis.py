"""The latent basis of the Gaussians: blending by an expression, and the training step.

A picture gives the basis a gradient of rank one, e ⊗ g. The full gradient is 40 to 60 times as
large as g and is never stored: `update_basis` takes e and g separately.
"""

import numpy as np
import torch
from torch import Tensor

from ico3d.head.blending.kernels import (
    adam_rank_one,
    blend_rows,
    blend_some,
    rmsprop_rank_one,
    row_products,
)
from ico3d.training.finite import check_gradient
from ico3d.training.optimiser import BETA2, EPSILON, Optimiser, adam_reference, bias_corrections


def blend(basis: Tensor, weights: Tensor) -> Tensor:
    """Blends the rows of the basis (paper, the equation of f_i); the bias f_0 is the last row.

    Args:
        basis: (R, N, w).
        weights: (R,) the expression with 1 appended.

    Returns:
        (N, w) features; differentiable in both arguments.
    """
    return _Blend.apply(basis, weights)  # type: ignore[no-any-return]


class _Blend(torch.autograd.Function):
    """Σ_r weights[r]·basis[r]."""

    @staticmethod
    def forward(ctx, basis: Tensor, weights: Tensor) -> Tensor:
        ctx.save_for_backward(basis, weights)
        if not _has_kernel(basis):
            return torch.einsum("rnw,r->nw", basis, weights)
        out = torch.empty(basis.shape[1:])  # (N, w)
        values = weights.contiguous().numpy()
        blend_rows(_rows(basis), values, np.flatnonzero(values), out.view(-1).numpy())
        return out

    @staticmethod
    def backward(ctx, *gradients: Tensor):
        basis, weights = ctx.saved_tensors
        gradient = gradients[0].contiguous()  # (N, w)
        for_basis = for_weights = None
        if ctx.needs_input_grad[0]:
            for_basis = weights[:, None, None] * gradient  # (R, N, w)
        if ctx.needs_input_grad[1]:
            for_weights = _weight_gradient(basis, gradient)  # (R,)
        return for_basis, for_weights


def _weight_gradient(basis: Tensor, gradient: Tensor) -> Tensor:
    if not _has_kernel(basis):
        return torch.einsum("rnw,nw->r", basis, gradient)
    out = torch.empty(basis.shape[0])  # (R,)
    row_products(_rows(basis), gradient.view(-1).numpy(), out.numpy())
    return out


def blend_of(basis: Tensor, weights: Tensor, chosen: Tensor) -> Tensor:
    """As `blend`, of some Gaussians alone, and without gradients.

    Args:
        basis: (R, N, w).
        weights: (R,) the expression with 1 appended.
        chosen: (n,) int64 numbers of the Gaussians.

    Returns:
        (n, w) features.
    """
    basis, weights = basis.detach(), weights.detach()
    if not _has_kernel(basis):
        return torch.einsum("rnw,r->nw", basis[:, chosen], weights)
    out = torch.empty(len(chosen), basis.shape[2])  # (n, w)
    values = weights.contiguous().numpy()
    blend_some(_rows(basis), values, np.flatnonzero(values), chosen.numpy(), out.numpy())
    return out


def update_basis(
    optimiser: Optimiser,
    basis: Tensor,
    weights: Tensor,
    gradient: Tensor,
    rate: float | Tensor,
    weight_decay: float = 0.0,
    rmsprop: bool = False,
    chosen: Tensor | None = None,
) -> None:
    """One step on the basis, in place, with the gradient weights ⊗ gradient.

    Rows of weight 0 keep their values and moments, and each row counts its own steps (lazy Adam, as
    usual for sparse gradients), because most blendshapes are 0 in most frames.

    Args:
        optimiser: Holds the moments under the name "basis".
        basis: (R, N, w).
        weights: (R,) the expression with 1 appended.
        gradient: (N, w) gradient of the loss by the blended features; (n, w) where some Gaussians
            are chosen.
        rate: Learning rate, or (R,) that of each row.
        weight_decay: Factor by which each row except the bias is added to its gradient (L2).
        rmsprop: Take a step of RMSProp instead of Adam: without first moments, and with one second
            moment for all features of a Gaussian in a row.
        chosen: (n,) int64 numbers of the only Gaussians to update; None for all.

    Raises:
        NotFiniteError: If the gradient holds NaN or infinity; then nothing is changed.
    """
    basis, weights, gradient = basis.detach(), weights.detach(), gradient.detach()
    check_gradient("basis", gradient)
    rates = torch.as_tensor(rate, dtype=basis.dtype).expand(len(weights))  # (R,)
    pulls = torch.full_like(weights, weight_decay)  # (R,)
    pulls[-1] = 0
    if optimiser.kind == "sgd":
        _sgd(basis, weights, gradient, rates, pulls, chosen)
    elif rmsprop:
        _rmsprop(optimiser, basis, weights, gradient, rates, pulls, chosen)
    else:
        _adam(optimiser, basis, weights, gradient, rates, pulls, chosen)


def _sgd(
    basis: Tensor,
    weights: Tensor,
    gradient: Tensor,
    rates: Tensor,
    pulls: Tensor,
    chosen: Tensor | None,
) -> None:
    """A step of plain descent."""
    part = _all_or(chosen)
    for row in torch.nonzero(weights)[:, 0].tolist():
        pulled = weights[row] * gradient + pulls[row] * basis[row, part]  # (N or n, w)
        basis[row, part] -= float(rates[row]) * pulled


def _adam(
    optimiser: Optimiser,
    basis: Tensor,
    weights: Tensor,
    gradient: Tensor,
    rates: Tensor,
    pulls: Tensor,
    chosen: Tensor | None,
) -> None:
    """A step of Adam; `rates` and `pulls` (R,) are the learning rate and weight decay by row."""
    rows = torch.nonzero(weights)[:, 0]  # (active,)
    first, second, counts = _moments(optimiser, basis)
    counts[rows.cpu()] += 1
    if _has_kernel(basis) and chosen is None:
        corrections = np.array([bias_corrections(max(int(n), 1)) for n in counts])  # (R, 2)
        adam_rank_one(
            _rows(basis),
            _rows(first),
            _rows(second),
            weights.contiguous().numpy(),
            gradient.contiguous().view(-1).numpy(),
            rows.numpy(),
            rates.numpy() * corrections[:, 0],
            corrections[:, 1].copy(),
            pulls.numpy(),
        )
        return
    part = _all_or(chosen)
    for row in rows.tolist():
        value, m, v = basis[row, part], first[row, part], second[row, part]  # (N or n, w) each
        pulled = weights[row] * gradient + pulls[row] * value
        adam_reference(value, m, v, pulled, float(rates[row]), bias_corrections(int(counts[row])))
        if chosen is not None:  # then they are copies
            basis[row, part], first[row, part], second[row, part] = value, m, v


def _rmsprop(
    optimiser: Optimiser,
    basis: Tensor,
    weights: Tensor,
    gradient: Tensor,
    rates: Tensor,
    pulls: Tensor,
    chosen: Tensor | None,
) -> None:
    """A step of RMSProp; `rates` and `pulls` (R,) are the learning rate and weight decay by row."""
    moments = optimiser.moments
    if "basis.second" not in moments:
        moments["basis.second"] = basis.new_zeros(basis.shape[:2])  # (R, N)
        moments["basis.steps"] = torch.zeros(basis.shape[0], dtype=torch.int64)
    second, counts = moments["basis.second"], moments["basis.steps"]
    rows = torch.nonzero(weights)[:, 0]  # (active,)
    counts[rows.cpu()] += 1
    roots = (1 - BETA2 ** counts.clamp_min(1).double()).rsqrt().float()  # (R,)
    if _has_kernel(basis):
        numbers = torch.arange(basis.shape[1]) if chosen is None else chosen  # (N or n,)
        rmsprop_rank_one(
            _rows(basis),
            second.numpy(),
            weights.contiguous().numpy(),
            gradient.contiguous().numpy(),
            rows.numpy(),
            rates.contiguous().numpy(),
            roots.numpy(),
            pulls.numpy(),
            numbers.numpy(),
        )
        return
    part = _all_or(chosen)
    for row in rows.tolist():
        pulled = weights[row] * gradient + pulls[row] * basis[row, part]  # (N or n, w)
        mean = BETA2 * second[row, part] + (1.0 - BETA2) * pulled.square().mean(1)  # (N or n,)
        second[row, part] = mean
        root = mean.sqrt() * float(roots[row]) + EPSILON
        basis[row, part] -= float(rates[row]) * pulled / root[:, None]


def _all_or(chosen: Tensor | None) -> Tensor | slice:
    """The index of the chosen Gaussians, or of all."""
    return slice(None) if chosen is None else chosen


def _moments(optimiser: Optimiser, basis: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Both moments (R, N, w) and the number of updates of each row (R,)."""
    moments = optimiser.moments
    if "basis.first" not in moments:
        moments["basis.first"] = torch.zeros_like(basis)
        moments["basis.second"] = torch.zeros_like(basis)
        moments["basis.steps"] = torch.zeros(basis.shape[0], dtype=torch.int64)
    return moments["basis.first"], moments["basis.second"], moments["basis.steps"]


def _has_kernel(basis: Tensor) -> bool:
    return basis.device.type == "cpu" and basis.dtype == torch.float32


def _rows(basis: Tensor) -> np.ndarray:
    """(R, N·w) view for the kernels."""
    return basis.detach().view(basis.shape[0], -1).numpy()
