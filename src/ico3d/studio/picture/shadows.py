"""Soft shadows of lamps that have a size: percentage-closer soft shadows in depth maps.

Fernando, "Percentage-closer soft shadows" (2005): the mean distance to what hides the lamp says how
wide the penumbra is, and the share of the depth map within it that lets light through says how much
of the lamp is seen.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ico3d.splat.cpu.compile import kernel, subroutine
from ico3d.studio.raster import depth_map, light_basis

BIAS = 0.003
"""Metres behind the depth map that still count as lit: fewer speckles, more leaking light."""
STEEPEST = 2.5
"""Largest slope of a surface in the depth map that the comparison follows."""
FARTHEST = 0.12
"""Metres to what hides a lamp beyond which shadows grow no softer."""
SHARPEST = 2.2
"""Radius in texels below which no penumbra shrinks: it hides the steps of the depth map."""
SEARCH, FILTER = 18, 22
"""Samples of the depth map: for what hides the lamp, and for the share that it hides."""


@dataclass(frozen=True)
class Covered:
    """The region that the depth maps of the lamps cover.

    Attributes:
        size: Side of a map in texels.
        reach: Half of the side in metres.
        centre: (3,) centre of the region, in the world if `whole`, else in canonical head space,
            metres.
        whole: Whether the region holds the whole person.
    """

    size: int
    reach: float
    centre: np.ndarray
    whole: bool


BUST = Covered(512, 0.40, np.array([0.0, -0.08, 0.0]), False)
WHOLE = Covered(1024, 1.25, np.array([0.0, 1.05, 0.0]), True)


class Shadow(NamedTuple):
    """The depth map of one lamp.

    Attributes:
        depth: (S, S) float32 nearness to the lamp of the first surface, metres plus 2.
        basis: (3, 3) float32 axes of the map (see `light_basis`).
        centre: (3,) float32 centre of the map, metres.
        scale: Texels per metre.
        size: Tangent of half the angle under which the lamp is seen.
        disc: (N, 2) float32 samples of the unit disc.
    """

    depth: np.ndarray
    basis: np.ndarray
    centre: np.ndarray
    scale: float
    size: float
    disc: np.ndarray


def cast(
    vertices: np.ndarray,
    faces: np.ndarray,
    solid: np.ndarray,
    towards: np.ndarray,
    size: float,
    covered: Covered,
    centre: np.ndarray,
) -> Shadow:
    """Draws the depth map of a distant lamp.

    Args:
        vertices: (V, 3) float32 metres.
        faces: (F, 3) int32.
        solid: (N,) int32 the faces that cast shadows.
        towards: (3,) unit vector towards the lamp.
        size: Tangent of half the angle under which the lamp is seen.
        covered: Size and reach of the map.
        centre: (3,) centre of the map in the space of the vertices, metres.
    """
    relative = vertices - centre.astype(np.float32)
    depth, _ = depth_map(relative, faces, solid, towards, covered.size, covered.reach)
    return Shadow(
        depth,
        light_basis(towards).astype(np.float32),
        centre.astype(np.float32),
        covered.size / (2.0 * covered.reach),
        size,
        vogel_disc(FILTER),
    )


def vogel_disc(count: int) -> np.ndarray:
    """(count, 2) float32 points that fill the unit disc evenly (Vogel's spiral)."""
    index = np.arange(count)
    turn, radius = index * np.pi * (3 - 5**0.5), np.sqrt((index + 0.5) / count)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], 1).astype(np.float32)


@kernel()
def seen(shadow, x, y, z, nx, ny, nz):
    """Share of a lamp that a point with a normal sees, 0 to 1."""
    basis, depth, scale = shadow.basis, shadow.depth, shadow.scale
    side = depth.shape[0]
    x, y, z = x - shadow.centre[0], y - shadow.centre[1], z - shadow.centre[2]
    u = (basis[0, 0] * x + basis[0, 1] * y + basis[0, 2] * z) * scale + 0.5 * side - 0.5
    v = (basis[1, 0] * x + basis[1, 1] * y + basis[1, 2] * z) * scale + 0.5 * side - 0.5
    here = basis[2, 0] * x + basis[2, 1] * y + basis[2, 2] * z + 2.0 + BIAS
    if u < 1.0 or v < 1.0 or u >= side - 2.0 or v >= side - 2.0:
        return 1.0
    # The surface goes on as a plane: its own neighbourhood does not shade it.
    facing = basis[2, 0] * nx + basis[2, 1] * ny + basis[2, 2] * nz
    facing = max(0.05, facing) * scale
    du = -(basis[0, 0] * nx + basis[0, 1] * ny + basis[0, 2] * nz) / facing
    dv = -(basis[1, 0] * nx + basis[1, 1] * ny + basis[1, 2] * nz) / facing
    steep = math.sqrt(du * du + dv * dv) * scale
    if steep > STEEPEST:
        du, dv = du * STEEPEST / steep, dv * STEEPEST / steep
    wide = shadow.size * FARTHEST * scale
    gap = _mean_gap(shadow, u, v, here, du, dv, wide)
    if gap <= 0.0:
        return 1.0
    radius = max(SHARPEST, shadow.size * min(gap, FARTHEST) * scale)
    total = 0.0
    for k in range(shadow.disc.shape[0]):
        a, b = radius * shadow.disc[k, 0], radius * shadow.disc[k, 1]
        total += _open(depth, u + a, v + b, here + a * du + b * dv)
    return total / shadow.disc.shape[0]


@subroutine()
def _mean_gap(shadow, u, v, here, du, dv, wide):
    """Weighted distance in metres to what hides the lamp around a texel; 0 if nothing does."""
    depth, disc = shadow.depth, shadow.disc
    side = depth.shape[0]
    gap, weight = 0.0, 0.0
    stride = disc.shape[0] / SEARCH
    for k in range(SEARCH + 1):
        a, b = 0.0, 0.0
        if k > 0:
            index = int((k - 0.5) * stride)
            # Denser near the middle, where also things that are close hide the lamp.
            away = wide * math.sqrt(disc[index, 0] ** 2 + disc[index, 1] ** 2)
            a, b = away * disc[index, 0], away * disc[index, 1]
        i, j = int(u + a + 0.5), int(v + b + 0.5)
        if i < 0 or j < 0 or i >= side or j >= side:
            continue
        nearer = depth[j, i] - (here + a * du + b * dv)
        if nearer > 0.0:
            # What is far off the surface makes the penumbra, not the surface's own unevenness.
            gap += nearer * nearer
            weight += nearer
    return gap / weight if weight > 0.0 else 0.0


@subroutine()
def _open(depth, u, v, here):
    """Share of the four texels around a place, by nearness, that nothing before `here` fills."""
    side = depth.shape[0]
    i, j = math.floor(u), math.floor(v)
    if i < 0 or j < 0 or i >= side - 1 or j >= side - 1:
        return 1.0
    s, t = u - i, v - j
    lit = 0.0
    if depth[j, i] <= here:
        lit += (1.0 - s) * (1.0 - t)
    if depth[j, i + 1] <= here:
        lit += s * (1.0 - t)
    if depth[j + 1, i] <= here:
        lit += (1.0 - s) * t
    if depth[j + 1, i + 1] <= here:
        lit += s * t
    return lit
