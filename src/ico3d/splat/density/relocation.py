"""Opacity and scale with which N copies at one place look like the one original Gaussian.

Kheradmand et al., "3D Gaussian Splatting as Markov Chain Monte Carlo", 2024, section 4.2 and eq. 9.
"""

# pyright: reportMissingImports=false, reportUnknownVariableType=false
# (gsplat is untyped, and not installed everywhere)

import importlib.util
import math
from functools import cache

import torch
from torch import Tensor

MAX_COPIES = 51
"""A larger number of copies is corrected as if there were this many, as in the paper's code."""

LARGEST_OPACITY = 1 - 1e-6
"""An opaque Gaussian's copies would be opaque too."""


def relocated(opacities: Tensor, scales: Tensor, copies: Tensor) -> tuple[Tensor, Tensor]:
    """Opacities and scales with which copies of a Gaussian together look like the original.

    The opacity o' is exact in the centre: (1 − o')^N = 1 − o. The scale s' preserves the light
    along a line through the centre: with g = o'·exp(−x²/2s'²), ∫ 1 − (1 − g)^N dx = o·s·√2π.

    Args:
        opacities: (M,) opacities of the originals, in [0, 1].
        scales: (M, 3) activated scales of the originals, metres.
        copies: (M,) int, N: number of copies, the original included; at least 1.

    Returns:
        Opacities (M,) and scales (M, 3) for every copy.
    """
    opacities = opacities.detach().clamp(0, LARGEST_OPACITY)
    copies = copies.clamp(1, MAX_COPIES)
    if len(opacities) and opacities.is_cuda and importlib.util.find_spec("gsplat"):
        from gsplat.relocation import compute_relocation

        table = _binomials().to(opacities)
        return compute_relocation(opacities, scales.detach(), copies.int(), table)
    new = -torch.expm1(torch.log1p(-opacities.double()) / copies)  # (M,)
    grown = opacities.double() / _line_integral(new, copies)  # (M,)
    factor = torch.where(opacities > 0, grown, 1.0)
    return new.to(opacities), scales.detach() * factor[:, None].to(scales)


def _line_integral(opacities: Tensor, copies: Tensor) -> Tensor:
    """(M,) float64: ∫ 1 − (1 − o·exp(−x²/2))^N dx / √2π = Σ_k C(N, k)·(−1)^(k+1)·oᵏ / √k."""
    table = _binomials().to(opacities)[copies]  # (M, MAX_COPIES + 1)
    orders = torch.arange(1, MAX_COPIES + 1).to(opacities)  # (MAX_COPIES,)
    signs = -((-1.0) ** orders)
    powers = opacities[:, None] ** orders  # (M, MAX_COPIES)
    return (table[:, 1:] * signs * powers / orders.sqrt()).sum(1)


@cache
def _binomials() -> Tensor:
    """(MAX_COPIES + 1, MAX_COPIES + 1) float64: C(n, k), 0 where k > n."""
    size = range(MAX_COPIES + 1)
    return torch.tensor([[float(math.comb(n, k)) for k in size] for n in size]).double()
