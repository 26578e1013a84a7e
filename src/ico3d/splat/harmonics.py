"""Real spherical harmonics up to degree 3, in the order and with the signs of 3D Gaussian files."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false
# (torch leaves some of its functions untyped)

import torch
from torch import Tensor

C0 = 0.28209479177387814
"""The constant harmonic; colour of degree 0 is ½ + C0·coefficient."""

MAX_DEGREE = 3


def degree_of(coefficients: int) -> int:
    """The degree of spherical harmonics that has (degree + 1)² = `coefficients` coefficients.

    Raises:
        ValueError: If no degree has this number, or the degree is above 3.
    """
    for degree in range(MAX_DEGREE + 1):
        if (degree + 1) ** 2 == coefficients:
            return degree
    raise ValueError(f"{coefficients} SH coefficients: expected 1, 4, 9 or 16")


def basis(directions: Tensor, degree: int) -> Tensor:
    """Values (..., (degree + 1)²) of the harmonics at unit directions (..., 3)."""
    x, y, z = directions.unbind(-1)
    values = [torch.full_like(x, C0)]
    if degree >= 1:
        c1 = 0.4886025119029199
        values += [-c1 * y, c1 * z, -c1 * x]
    if degree >= 2:
        values += [
            1.0925484305920792 * x * y,
            -1.0925484305920792 * y * z,
            0.31539156525252005 * (2 * z * z - x * x - y * y),
            -1.0925484305920792 * x * z,
            0.5462742152960396 * (x * x - y * y),
        ]
    if degree >= 3:
        values += [
            -0.5900435899266435 * y * (3 * x * x - y * y),
            2.890611442640554 * x * y * z,
            -0.4570457994644658 * y * (4 * z * z - x * x - y * y),
            0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y),
            -0.4570457994644658 * x * (4 * z * z - x * x - y * y),
            1.445305721320277 * z * (x * x - y * y),
            -0.5900435899266435 * x * (x * x - 3 * y * y),
        ]
    return torch.stack(values, -1)


def to_colors(sh: Tensor, directions: Tensor) -> Tensor:
    """Colours (..., N, 3), at least 0, of coefficients (N, K, 3) seen along (..., N, 3)."""
    degree = degree_of(sh.shape[-2])
    weights = basis(torch.nn.functional.normalize(directions, dim=-1), degree)  # (..., N, K)
    return (torch.einsum("...nk,nkc->...nc", weights, sh) + 0.5).clamp_min(0)


def of_colors(colors: Tensor, rest: Tensor | None = None) -> Tensor:
    """Coefficients (N, K, 3) of colours (N, 3) that depend on the view by `rest` (N, K − 1, 3)."""
    base = ((colors - 0.5) / C0)[:, None]  # (N, 1, 3)
    return base if rest is None else torch.cat([base, rest], 1)  # (N, K, 3)


def rotate(sh: Tensor, rotation: Tensor) -> Tensor:
    """Coefficients (N, K, 3) for objects that were turned by `rotation` (3, 3).

    The matrix of each degree is solved for on fixed directions; the result is exact, because a
    rotation maps harmonics of one degree to harmonics of the same degree.
    """
    degree = degree_of(sh.shape[-2])
    points = torch.randn(64, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    points = torch.nn.functional.normalize(points, dim=-1)  # (64, 3)
    turned = points @ rotation.detach().cpu().double()  # (64, 3), rows Rᵀ·d
    change = torch.linalg.lstsq(basis(points, degree), basis(turned, degree)).solution  # (K, K)
    return torch.einsum("jk,nkc->njc", change.to(sh), sh)
