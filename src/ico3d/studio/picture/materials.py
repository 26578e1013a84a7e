"""Procedural materials: albedo and gloss of each material at one point, before any light."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from ico3d.studio.picture.textures import grain, noise, smoothstep, spots, strands


class Spot(NamedTuple):
    """Surface properties at one point.

    Attributes:
        red: Albedo, linear, red.
        green: Albedo, linear, green.
        blue: Albedo, linear, blue.
        power: Exponent of the highlight: higher is sharper.
        facing: Reflectance at frontal view; 0 for no highlight.
        wrap: How far diffuse light reaches past the terminator.
        bump: How far fine relief tilts the normal.
    """

    red: float
    green: float
    blue: float
    power: float
    facing: float
    wrap: float
    bump: float


class Colors(NamedTuple):
    """The colours of a `Look` as arrays for the shader, and some lengths.

    `bold`: whether the shirt has a print that is visible from far away. `floor`: height of the
    ground in canonical head space at rest, metres. `legs`: (2, 3) left hip and ankle at rest,
    metres.
    """

    skin: np.ndarray
    lips: np.ndarray
    hair: np.ndarray
    iris: np.ndarray
    cloth: np.ndarray
    stripes: bool
    freckles: float
    stubble: float
    accent: np.ndarray
    trousers: np.ndarray
    shoe: np.ndarray
    bold: bool
    floor: float
    legs: np.ndarray
    skirt: np.ndarray


@njit(cache=True, nogil=True)
def skin(colors, channels, x, y, z, pixel):
    """Skin with blotches, pores, freckles, a shaved beard, and lips with fine creases."""
    lip, red, freckle, beard, scalp, _ = channels
    blotch = 0.055 * grain(x, y, z, 0.022, pixel) + 0.05 * grain(x, y, z, 0.008, pixel)
    pores = 0.05 * grain(x, y, z, 0.0026, pixel) + 0.05 * grain(x, y, z, 0.0011, pixel)
    shade = 1.0 + blotch + pores
    flush = 0.38 * red * (1.0 + 0.5 * grain(x + 3.0, y, z, 0.014, pixel))
    r = colors.skin[0] * shade * (1.0 - 0.08 * flush)
    g = colors.skin[1] * shade * (1.0 - 0.42 * flush)
    b = colors.skin[2] * shade * (1.0 - 0.40 * flush)
    dots = spots(x, y, z, 0.0045, pixel) + 0.6 * spots(x + 1.0, y, z, 0.0027, pixel)
    dots = min(1.0, dots) * colors.freckles * (0.12 + freckle)
    r, g, b = r * (1.0 - 0.30 * dots), g * (1.0 - 0.48 * dots), b * (1.0 - 0.55 * dots)
    shadow = colors.stubble * beard * (0.75 + 0.5 * noise(x / 0.0009, y / 0.0009, z / 0.0009))
    r, g, b = r * (1.0 - 0.50 * shadow), g * (1.0 - 0.42 * shadow), b * (1.0 - 0.32 * shadow)
    roots = min(1.0, 0.9 * scalp * (0.8 + 0.4 * noise(x / 0.0015, y / 0.004, z / 0.0015)))
    r += (1.5 * colors.hair[0] - r) * roots
    g += (1.5 * colors.hair[1] - g) * roots
    b += (1.5 * colors.hair[2] - b) * roots
    crease = grain(x * 3.0, y * 0.6, z, 0.0024, pixel)
    edge = smoothstep(0.15, 0.75, lip)
    tint = 1.0 + 0.10 * crease + 0.05 * grain(x, y, z, 0.004, pixel)
    r += (colors.lips[0] * tint - r) * edge
    g += (colors.lips[1] * tint - g) * edge
    b += (colors.lips[2] * tint - b) * edge
    return Spot(r, g, b, 18.0 + 22.0 * edge, 0.035 + 0.012 * edge, 0.27, 0.05 + 0.05 * edge)


@njit(cache=True, nogil=True)
def eye(colors, radius, angle, iris_radius, x, y, z, pixel):
    """Sclera, limbal ring, iris fibres and pupil, by the distance `radius` from the axis."""
    soft = max(0.00025, 0.5 * pixel)
    vein = smoothstep(0.25, 0.9, grain(x, y * 1.5, z, 0.0016, pixel)) * 0.12
    far = smoothstep(1.2 * iris_radius, 2.0 * iris_radius, radius)
    r, g, b = 0.72 - 0.06 * far, 0.67 - (0.13 + vein) * far, 0.63 - (0.15 + vein) * far
    t = radius / iris_radius
    fibre = strands(angle / 6.2832, t, 70.0, pixel / (6.2832 * max(radius, 1e-4)))
    glow = (1.25 - 0.55 * t) * (1.0 + 0.6 * fibre)
    ring = smoothstep(0.72, 1.0, t)
    warm = 1.0 - smoothstep(0.40, 0.62, t)
    ir = 0.8 * colors.iris[0] * glow * (1.0 - 0.8 * ring) * (1.0 + 0.9 * warm)
    ig = 0.8 * colors.iris[1] * glow * (1.0 - 0.8 * ring) * (1.0 + 0.25 * warm)
    ib = 0.8 * colors.iris[2] * glow * (1.0 - 0.75 * ring) * (1.0 - 0.2 * warm)
    inside = 1.0 - smoothstep(iris_radius - 1.2 * soft, iris_radius + 1.2 * soft, radius)
    r, g, b = r + (ir - r) * inside, g + (ig - g) * inside, b + (ib - b) * inside
    pupil = 0.40 * iris_radius
    hole = 1.0 - smoothstep(pupil - soft, pupil + soft, radius)
    r, g, b = r + (0.004 - r) * hole, g + (0.004 - g) * hole, b + (0.004 - b) * hole
    return Spot(r, g, b, 320.0, 0.05, 0.25, 0.0)


@njit(cache=True, nogil=True)
def teeth(x, y, z, pixel):
    """Ivory that is warmer near the gums."""
    shade = 1.0 + 0.04 * grain(x, y, z, 0.003, pixel)
    return Spot(0.70 * shade, 0.63 * shade, 0.52 * shade, 70.0, 0.045, 0.3, 0.0)


@njit(cache=True, nogil=True)
def flesh(red, green, blue, x, y, z, pixel):
    """Wet gums, tongue and the inside of the cheeks."""
    shade = 1.0 + 0.12 * grain(x, y, z, 0.0035, pixel) + 0.08 * grain(x, y, z, 0.0014, pixel)
    return Spot(red * shade, green * shade, blue * shade, 60.0, 0.035, 0.3, 0.08)


@njit(cache=True, nogil=True)
def hair(colors, u, v, x, y, z, pixel_u):
    """Strands along v; highlights are added by the shader."""
    fine = strands(u, v, 700.0, pixel_u)
    lock = 2.0 * noise(u * 34.0, v * 2.0, 3.0) - 1.0
    shade = 1.0 + 0.75 * fine + 0.40 * lock
    grey = 0.12 * max(0.0, fine)
    return Spot(
        colors.hair[0] * shade + grey * 0.03,
        colors.hair[1] * shade + grey * 0.02,
        colors.hair[2] * shade + grey * 0.015,
        0.0,
        0.0,
        0.2,
        0.0,
    )


@njit(cache=True, nogil=True)
def _flower(u, v, blur):
    """A five-leaved flower in each cell of a staggered grid, 0 to 1; lengths in cells."""
    column = math.floor(u)
    shifted = v + 0.5 * (column % 2)
    du, dv = u - column - 0.5, shifted - math.floor(shifted) - 0.5
    reach = 0.24 + 0.06 * math.sin(5.0 * math.atan2(dv, du))
    return 1.0 - smoothstep(reach - blur, reach + blur, math.sqrt(du * du + dv * dv))


@njit(cache=True, nogil=True)
def _stripe(v, blur):
    """A broad and a narrow stripe in each unit of v, 0 to 1."""
    t = v - math.floor(v)
    broad = smoothstep(0.1 - blur, 0.1 + blur, t) - smoothstep(0.38 - blur, 0.38 + blur, t)
    narrow = smoothstep(0.46 - blur, 0.46 + blur, t) - smoothstep(0.52 - blur, 0.52 + blur, t)
    return broad + narrow


@njit(cache=True, nogil=True)
def cloth(colors, u, v, x, y, z, pixel):
    """A knitted pullover with a pattern; u and v are metres along the cloth."""
    rib = math.sin(6.2832 * u / 0.0048)
    row = math.sin(6.2832 * v / 0.0038 + 1.6 * abs(rib))
    knit = min(1.0, max(0.0, 0.0042 / pixel - 1.0))
    wool = 0.10 * grain(x, y, z, 0.004, pixel) + 0.07 * grain(x, y, z, 0.016, pixel)
    fibre = 0.10 * grain(x, y, z, 0.0012, pixel)
    shade = 1.0 + wool + fibre + knit * 0.20 * (0.55 * rib + 0.45 * row)
    if colors.stripes:
        mark = _stripe(y / 0.055 + 0.02 * rib, max(0.02, 0.6 * pixel / 0.055))
    else:
        mark = _flower(u / 0.045, v / 0.045, max(0.03, 0.6 * pixel / 0.045))
    base, pattern = colors.cloth[0], colors.cloth[1]
    return Spot(
        (base[0] + (pattern[0] - base[0]) * mark) * shade,
        (base[1] + (pattern[1] - base[1]) * mark) * shade,
        (base[2] + (pattern[2] - base[2]) * mark) * shade,
        6.0,
        0.02,
        0.35,
        0.12,
    )
