"""The lights of the studio and how surfaces answer them, in linear light."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from ico3d.capture.synthetic.paint import light_basis, light_screen
from ico3d.capture.synthetic.raster import empty_buffers, rasterise

SHADOW_SIZE = 448
SHADOW_REACH = 0.36
SHADOW_BIAS = 0.004
"""Metres behind the shadow map that are still lit: less speckles, more leaks."""

DIRECTIONS = np.array([[-0.55, 0.55, 0.80], [0.85, 0.15, 0.60], [0.75, 0.55, -0.75]])
"""Towards key, fill and rim light, in the world."""
COLORS = np.array([[1.25, 1.17, 1.06], [0.26, 0.28, 0.33], [0.60, 0.62, 0.66]])
SKY = np.array([0.34, 0.36, 0.395])
GROUND = np.array([0.17, 0.155, 0.14])


class Lights(NamedTuple):
    """Lights as the person's canonical space sees them in one frame.

    Attributes:
        directions: (3, 3) float32 rows: unit vectors towards key, fill and rim light.
        colors: (3, 3) float32 linear RGB.
        up: (3,) float32, the world's up.
        sky: (3,) float32 light from above; `ground` from below.
        ground: (3,) float32.
        shadow: (S, S) float32 depth map of the key light.
        basis: (3, 3) float32 of the key light's depth map.
    """

    directions: np.ndarray
    colors: np.ndarray
    up: np.ndarray
    sky: np.ndarray
    ground: np.ndarray
    shadow: np.ndarray
    basis: np.ndarray


def lights_on(vertices: np.ndarray, solid: np.ndarray, world_from_head: np.ndarray) -> Lights:
    """The studio's lights for one frame.

    Args:
        vertices: (V, 3) float32 posed, canonical head space.
        solid: (F, 3) int32 faces that cast shadows.
        world_from_head: (4, 4) pose of the head.
    """
    unit = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
    rotation = world_from_head[:3, :3]
    directions = unit @ rotation  # rows: Rᵀ·direction
    screen = light_screen(vertices, directions[0], SHADOW_SIZE, SHADOW_REACH)
    shadow, triangle, barycentric = empty_buffers(SHADOW_SIZE, SHADOW_SIZE)
    rasterise(screen, solid, shadow, triangle, barycentric)
    return Lights(
        directions=directions.astype(np.float32),
        colors=COLORS.astype(np.float32),
        up=rotation[1].astype(np.float32),
        sky=SKY.astype(np.float32),
        ground=GROUND.astype(np.float32),
        shadow=shadow,
        basis=light_basis(directions[0]).astype(np.float32),
    )


@njit(cache=True, nogil=True)
def key_visibility(lights, x, y, z):
    """Part of the key light that reaches a point, 0 to 1: a soft 4×4 look-up."""
    basis, shadow = lights.basis, lights.shadow
    size = shadow.shape[0]
    scale = size / (2.0 * SHADOW_REACH)
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
    """Diffuse light that bleeds past the terminator, as under skin; energy is kept."""
    value = max(0.0, (cosine + wrap) / (1.0 + wrap))
    return value / (1.0 + wrap)


@njit(cache=True, nogil=True)
def gloss(n_dot_h, n_dot_l, v_dot_h, power, facing):
    """Normalised Blinn-Phong highlight with Fresnel, `facing` = reflectance head on."""
    if n_dot_l <= 0.0 or n_dot_h <= 0.0:
        return 0.0
    fresnel = facing + (1.0 - facing) * (1.0 - max(0.0, v_dot_h)) ** 5
    return fresnel * (power + 8.0) / 25.13 * n_dot_h**power * n_dot_l
