"""Procedural materials: albedo and gloss of each material at one point, before any light."""

import math
from typing import NamedTuple

import numpy as np

from ico3d.splat.cpu.compile import subroutine
from ico3d.studio.picture.textures import grain, noise, smoothstep, strands

GROOVE = 0.0016
"""Half of the width of the groove along a tongue, metres."""


class Spot(NamedTuple):
    """Surface properties at one point.

    Attributes:
        red: Albedo, linear, red.
        green: Albedo, linear, green.
        blue: Albedo, linear, blue.
        roughness: Of the highlight, 0 to 1: lower is sharper; its square is GGX's alpha.
        facing: Reflectance at frontal view; 0 for no highlight.
        scatter: How far diffuse light reaches past the terminator, as a cosine.
        bump: How far fine relief tilts the normal.
        sheen: Light that fuzz sends back where the surface is seen at a grazing angle.
    """

    red: float
    green: float
    blue: float
    roughness: float
    facing: float
    scatter: float
    bump: float
    sheen: float


class Colors(NamedTuple):
    """The colours of a `Look` as arrays for the shader, and some lengths.

    `bold`: whether the shirt has a print that is visible from far away. `plain`: whether clothes
    are knitwear and jeans instead of prints. `floor`: height of the
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
    plain: bool
    jumper: np.ndarray
    jeans: np.ndarray
    leather: np.ndarray


@subroutine(fast=False)
def teeth(x, y, z, pixel):
    """Ivory that is warmer near the gums."""
    shade = 1.0 + 0.04 * grain(x, y, z, 0.003, pixel)
    return Spot(0.70 * shade, 0.63 * shade, 0.52 * shade, 0.41, 0.045, 0.3, 0.0, 0.0)


@subroutine(fast=False)
def frame():
    """Dark, polished plastic of a pair of glasses."""
    return Spot(0.012, 0.010, 0.009, 0.28, 0.05, 0.05, 0.0, 0.0)


@subroutine(fast=False)
def flesh(red, green, blue, x, y, z, pixel):
    """Wet gums, tongue and the inside of the cheeks."""
    shade = 1.0 + 0.12 * grain(x, y, z, 0.0035, pixel) + 0.08 * grain(x, y, z, 0.0014, pixel)
    return Spot(red * shade, green * shade, blue * shade, 0.42, 0.035, 0.3, 0.08, 0.0)


@subroutine(fast=False)
def tongue(x, y, z, pixel):
    """A moist back with a groove along its middle, pale with fine bumps and pink at its sides."""
    groove = math.exp(-((x / GROOVE) ** 2)) * smoothstep(0.066, 0.050, z)
    coat = 0.5 + 0.5 * grain(x, y, z, 0.0011, pixel) + 0.4 * grain(x + 3.0, y, z, 0.0040, pixel)
    pale = max(0.0, coat) * (1.0 - smoothstep(0.006, 0.015, abs(x)))
    shade = 1.0 - 0.38 * groove
    return Spot(
        (0.56 + 0.06 * pale) * shade,
        (0.25 + 0.10 * pale) * shade,
        (0.23 + 0.09 * pale) * shade,
        0.36,
        0.04,
        0.3,
        0.24,
        0.0,
    )


@subroutine(fast=False)
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
        1.0,
        0.0,
        0.2,
        0.0,
        0.0,
    )


@subroutine(fast=False)
def _flower(u, v, blur):
    """A five-leaved flower in each cell of a staggered grid, 0 to 1; lengths in cells."""
    column = math.floor(u)
    shifted = v + 0.5 * (column % 2)
    du, dv = u - column - 0.5, shifted - math.floor(shifted) - 0.5
    reach = 0.24 + 0.06 * math.sin(5.0 * math.atan2(dv, du))
    return 1.0 - smoothstep(reach - blur, reach + blur, math.sqrt(du * du + dv * dv))


@subroutine(fast=False)
def _stripe(v, blur):
    """A broad and a narrow stripe in each unit of v, 0 to 1."""
    t = v - math.floor(v)
    broad = smoothstep(0.1 - blur, 0.1 + blur, t) - smoothstep(0.38 - blur, 0.38 + blur, t)
    narrow = smoothstep(0.46 - blur, 0.46 + blur, t) - smoothstep(0.52 - blur, 0.52 + blur, t)
    return broad + narrow


@subroutine(fast=False)
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
        0.7,
        0.02,
        0.35,
        0.12,
        0.0,
    )
