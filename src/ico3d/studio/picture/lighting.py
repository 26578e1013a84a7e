"""The lights of the studio, and how surfaces reflect them, in linear light."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from ico3d.studio.picture.paint import light_basis, light_screen
from ico3d.studio.raster import empty_buffers, rasterise

SHADOW_BIAS = 0.004
"""Depth in metres behind the shadow map that still counts as lit.

A larger value gives fewer speckles but lets more light leak into shadows.
"""


@dataclass(frozen=True)
class Lamps:
    """The lights of a studio: distant lamps and surrounding light, in linear RGB.

    Attributes:
        directions: (3, 3) rows: unit vectors towards key, fill and rim light, in the world.
        colors: (3, 3) rows: colours of key, fill and rim light.
        sky: (3,) light from above.
        ground: (3,) light from below.
        cloth: (3,) light that the grey cloth behind the person reflects.
    """

    directions: np.ndarray
    colors: np.ndarray
    sky: np.ndarray
    ground: np.ndarray
    cloth: np.ndarray


STUDIOS = {
    "studio": Lamps(
        np.array([[-0.55, 0.55, 0.80], [0.85, 0.15, 0.60], [0.75, 0.55, -0.75]]),
        np.array([[1.25, 1.17, 1.06], [0.26, 0.28, 0.33], [0.60, 0.62, 0.66]]),
        np.array([0.34, 0.36, 0.395]),
        np.array([0.17, 0.155, 0.14]),
        np.array([0.92, 0.97, 1.06]),
    ),
    "warm": Lamps(
        np.array([[0.75, 0.45, 0.65], [-0.80, 0.25, 0.55], [-0.60, 0.65, -0.80]]),
        np.array([[1.42, 1.02, 0.62], [0.30, 0.24, 0.19], [0.72, 0.52, 0.34]]),
        np.array([0.40, 0.335, 0.26]),
        np.array([0.20, 0.145, 0.095]),
        np.array([1.15, 0.93, 0.70]),
    ),
}
"""`studio`: neutral, key light from the person's right; `warm`: like bulbs, from the left."""


@dataclass(frozen=True)
class ShadowMap:
    """The region that a depth map of the key light covers.

    Attributes:
        size: Side of the map in texels.
        reach: Half of the side in metres.
        centre: (3,) centre of the region, in the world if `whole`, else in canonical head space,
            metres.
        whole: Whether the region holds the whole person.
    """

    size: int
    reach: float
    centre: np.ndarray
    whole: bool


BUST = ShadowMap(448, 0.36, np.zeros(3), False)
WHOLE = ShadowMap(1024, 1.25, np.array([0.0, 1.05, 0.0]), True)


class Lights(NamedTuple):
    """The lights of one frame in the person's canonical space.

    Attributes:
        directions: (3, 3) float32 rows: unit vectors towards key, fill and rim light.
        colors: (3, 3) float32 linear RGB.
        up: (3,) float32, upward direction of the world.
        sky: (3,) float32 light from above.
        ground: (3,) float32 light from below.
        shadow: (S, S) float32 depth map of the key light.
        basis: (3, 3) float32 axes of the depth map (see `light_basis`).
        centre: (3,) float32 centre of the depth map, metres.
        scale: Texels of the depth map per metre.
    """

    directions: np.ndarray
    colors: np.ndarray
    up: np.ndarray
    sky: np.ndarray
    ground: np.ndarray
    shadow: np.ndarray
    basis: np.ndarray
    centre: np.ndarray
    scale: float


def lights_on(
    vertices: np.ndarray,
    solid: np.ndarray,
    world_from_head: np.ndarray,
    lamps: Lamps,
    covered: ShadowMap,
) -> Lights:
    """The studio's lights for one frame.

    Args:
        vertices: (V, 3) float32 posed, canonical head space.
        solid: (F, 3) int32 faces that cast shadows.
        world_from_head: (4, 4) pose of the head.
        lamps: How the studio is lit.
        covered: The region in which shadows are computed.
    """
    unit = lamps.directions / np.linalg.norm(lamps.directions, axis=1, keepdims=True)
    rotation = world_from_head[:3, :3]
    directions = unit @ rotation  # rows: Rᵀ·direction
    centre = covered.centre
    if covered.whole:
        centre = (centre - world_from_head[:3, 3]) @ rotation
    screen = light_screen(vertices - centre, directions[0], covered.size, covered.reach)
    shadow, triangle, barycentric = empty_buffers(covered.size, covered.size)
    rasterise(screen, solid, shadow, triangle, barycentric)
    return Lights(
        directions=directions.astype(np.float32),
        colors=lamps.colors.astype(np.float32),
        up=rotation[1].astype(np.float32),
        sky=lamps.sky.astype(np.float32),
        ground=lamps.ground.astype(np.float32),
        shadow=shadow,
        basis=light_basis(directions[0]).astype(np.float32),
        centre=centre.astype(np.float32),
        scale=covered.size / (2.0 * covered.reach),
    )


@njit(cache=True, nogil=True)
def key_visibility(lights, x, y, z):
    """Share of the key light that reaches a point, 0 to 1: a soft 4×4 look-up in the depth map."""
    basis, shadow = lights.basis, lights.shadow
    size = shadow.shape[0]
    scale = lights.scale
    x, y, z = x - lights.centre[0], y - lights.centre[1], z - lights.centre[2]
    u = (basis[0, 0] * x + basis[0, 1] * y + basis[0, 2] * z) * scale + 0.5 * size - 0.5
    v = (basis[1, 0] * x + basis[1, 1] * y + basis[1, 2] * z) * scale + 0.5 * size - 0.5
    depth = basis[2, 0] * x + basis[2, 1] * y + basis[2, 2] * z + 2.0 + SHADOW_BIAS
    i, j = math.floor(u), math.floor(v)
    if i < 2 or j < 2 or i >= size - 3 or j >= size - 3:
        return 1.0
    lit = 0.0
    for dj in range(-1, 3):
        weight_j = 1.0 - abs(v - j - dj) / 2.0
        for di in range(-1, 3):
            if shadow[j + dj, i + di] <= depth:
                lit += weight_j * (1.0 - abs(u - i - di) / 2.0)
    return min(1.0, lit / 4.0)


@njit(cache=True, nogil=True)
def wrapped(cosine, wrap):
    """Diffuse light that reaches past the terminator, as in skin; total energy is kept."""
    value = max(0.0, (cosine + wrap) / (1.0 + wrap))
    return value / (1.0 + wrap)


@njit(cache=True, nogil=True)
def gloss(n_dot_h, n_dot_l, v_dot_h, power, facing):
    """Normalised Blinn-Phong highlight with Fresnel effect; `facing` is the frontal reflectance."""
    if n_dot_l <= 0.0 or n_dot_h <= 0.0:
        return 0.0
    fresnel = facing + (1.0 - facing) * (1.0 - max(0.0, v_dot_h)) ** 5
    return fresnel * (power + 8.0) / 25.13 * n_dot_h**power * n_dot_l
