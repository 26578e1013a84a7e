"""Light on surfaces: from all around, by the direction in which they face, and from a lamp."""

from functools import cache

import torch
from torch import Tensor

from ico3d.rig.shadow_map import WRAP
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


def lamp_lit(normals: Tensor, reach: Tensor, direction: Tensor, strength: Tensor) -> Tensor:
    """What a distant lamp adds to the colour logits of surfaces.

    Of dark colours, logits are the logarithm: light from all around adds to them what it
    multiplies colours by, and the lamp adds itself to that light.

    Args:
        normals: (N, 3) unit vectors.
        reach: (N,) share of its light that nothing else stops, 0 to 1.
        direction: (3,) unit vector towards the lamp.
        strength: (3,) logarithms of its light where it falls straight on, RGB, in units of the
            light from all around.

    Returns:
        (N, 3), at least 0.
    """
    facing = (normals @ direction + WRAP).clamp_min(0)  # (N,)
    return torch.log1p((reach * facing)[:, None] * strength.exp())


@cache
def _harmonics_of_polynomials() -> Tensor:
    """(9, 8) float64: coefficients of x, y, z, xx, yy, zz, xy, xz, yz in each harmonic."""
    generator = torch.Generator().manual_seed(0)
    places = torch.randn(64, 3, generator=generator, dtype=torch.float64)
    places = torch.nn.functional.normalize(places, dim=1)
    polynomials = torch.cat([places, places[:, FIRST] * places[:, SECOND]], 1)  # (64, 9)
    wanted = harmonics.basis(places, 2)[:, 1:]  # (64, 8)
    return torch.linalg.lstsq(polynomials, wanted).solution
