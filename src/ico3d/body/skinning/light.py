"""Light on surfaces that depends only on the direction in which they face."""

from functools import cache

import torch
from torch import Tensor

from ico3d.splat import harmonics

LIGHTS = 8
"""Number of spherical harmonics of degrees 1 and 2."""
FIRST, SECOND = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
"""Axes of the first and second factor of the products xx, yy, zz, xy, xz, yz."""


def lit(normals: Tensor, light: Tensor) -> Tensor:
    """What light adds to the colour logits of surfaces.

    Args:
        normals: (N, 3) directions in which surfaces face, of length 1.
        light: (8, 3) coefficients of the harmonics of degrees 1 and 2, for R, G and B.

    Returns:
        (N, 3) logits.
    """
    products = normals[:, FIRST] * normals[:, SECOND]  # (N, 6)
    polynomials = torch.cat([normals, products], 1)  # (N, 9)
    return polynomials @ (_harmonics_of_polynomials().to(light) @ light)


@cache
def _harmonics_of_polynomials() -> Tensor:
    """(9, 8) float64: coefficients of x, y, z, xx, yy, zz, xy, xz, yz in each harmonic."""
    generator = torch.Generator().manual_seed(0)
    places = torch.randn(64, 3, generator=generator, dtype=torch.float64)
    places = torch.nn.functional.normalize(places, dim=1)
    polynomials = torch.cat([places, places[:, FIRST] * places[:, SECOND]], 1)  # (64, 9)
    wanted = harmonics.basis(places, 2)[:, 1:]  # (64, 8)
    return torch.linalg.lstsq(polynomials, wanted).solution
