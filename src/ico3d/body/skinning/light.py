"""Light that depends on where a surface faces alone."""

from functools import cache

import torch
from torch import Tensor

from ico3d.splat import harmonics

LIGHTS = 8
"""Spherical harmonics of degrees 1 and 2."""
FIRST, SECOND = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
"""Axes of the products xx, yy, zz, xy, xz, yz."""


def lit(normals: Tensor, light: Tensor) -> Tensor:
    """What light adds to surfaces.

    Args:
        normals: (N, 3) unit vectors.
        light: (8, 3) coefficients of the harmonics of degrees 1 and 2, RGB.

    Returns:
        (N, 3).
    """
    products = normals[:, FIRST] * normals[:, SECOND]  # (N, 6)
    polynomials = torch.cat([normals, products], 1)  # (N, 9)
    return polynomials @ (_harmonics_of_polynomials().to(light) @ light)


@cache
def _harmonics_of_polynomials() -> Tensor:
    """(9, 8) float64: the harmonics as sums of x, y, z, xx, yy, zz, xy, xz, yz."""
    generator = torch.Generator().manual_seed(0)
    places = torch.randn(64, 3, generator=generator, dtype=torch.float64)
    places = torch.nn.functional.normalize(places, dim=1)
    polynomials = torch.cat([places, places[:, FIRST] * places[:, SECOND]], 1)  # (64, 9)
    wanted = harmonics.basis(places, 2)[:, 1:]  # (64, 8)
    return torch.linalg.lstsq(polynomials, wanted).solution
