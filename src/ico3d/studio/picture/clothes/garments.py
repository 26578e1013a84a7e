"""Textures of a whole person's clothes: prints that are visible from metres away."""

import math

from ico3d.splat.cpu.compile import subroutine
from ico3d.studio.picture.materials import Spot
from ico3d.studio.picture.textures import grain, noise, smoothstep

TROUSER_CHECK = 0.052
"""Distance between two lines of the trousers' checks, metres."""
CHECKS = 10
"""Number of lines of the checks around a leg."""
GORES = 14
"""Number of panels around a skirt, in two alternating colours."""


@subroutine(fast=False)
def _patch(x, y, z, size, least, pixel):
    """Irregular patches of `size` metres with sharp edges, 0 to 1, the fewer the higher `least`."""
    blur = max(0.03, 0.8 * pixel / size)
    value = noise(x / size, y / size, z / size)
    return smoothstep(least - blur, least + blur, value)


@subroutine(fast=False)
def _band(t, width, pixel):
    """Lines of a grid with unit spacing, 0 to 1; `pixel` in units of t."""
    blur = max(0.02, 0.8 * pixel)
    away = abs(t - math.floor(t) - 0.5)
    return 1.0 - smoothstep(0.5 * width - blur, 0.5 * width + blur, away)


@subroutine(fast=False)
def printed(colors, x, y, z, pixel):
    """A shirt in bands, each sprinkled with patches of the next band's colour."""
    warp = 0.012 * (noise(x / 0.06, y / 0.06, z / 0.06) - 0.5)
    broad = _band((y + warp) / 0.088, 0.5, pixel / 0.088)
    large = _patch(x, y, z, 0.042, 0.58, pixel)
    small = _patch(x + 7.0, y, z, 0.021, 0.62, pixel)
    wool = 0.16 * grain(x, y, z, 0.012, pixel) + 0.10 * grain(x, y, z, 0.004, pixel)
    shade = 1.0 + wool + 0.10 * (2.0 * noise(x / 0.09, y / 0.09, z / 0.09) - 1.0)
    base, pattern, accent = colors.cloth[0], colors.cloth[1], colors.accent
    mark = broad + large - 2.0 * broad * large
    r = base[0] + (pattern[0] - base[0]) * mark
    g = base[1] + (pattern[1] - base[1]) * mark
    b = base[2] + (pattern[2] - base[2]) * mark
    r, g, b = (
        r + (accent[0] - r) * small,
        g + (accent[1] - g) * small,
        b + (accent[2] - b) * small,
    )
    return Spot(r * shade, g * shade, b * shade, 0.7, 0.02, 0.35, 0.12, 0.0)


@subroutine(fast=False)
def trousers(colors, x, y, z, pixel):
    """Checked cloth with worn patches."""
    hip, ankle = colors.legs[0], colors.legs[1]
    down = (hip[1] - y) / (hip[1] - ankle[1])
    out = abs(x) - hip[0] - down * (ankle[0] - hip[0])
    around = CHECKS * math.atan2(z - hip[2], out) / 6.2832
    across = pixel / TROUSER_CHECK
    upright = _band(around, 0.22, across)
    level = _band(y / TROUSER_CHECK, 0.22, across)
    fine = _band(around + 0.5, 0.10, across)
    worn = 0.35 * (2.0 * noise(x / 0.07, y / 0.07, z / 0.07) - 1.0)
    weave = 0.14 * grain(x, y * 2.0, z, 0.009, pixel) + 0.12 * grain(x, y, z, 0.003, pixel)
    shade = 1.0 + 0.5 * worn + weave
    mark = min(1.0, 0.55 * upright + 0.55 * level)
    base, pattern = colors.trousers[0], colors.trousers[1]
    r = base[0] + (pattern[0] - base[0]) * mark + 0.10 * fine
    g = base[1] + (pattern[1] - base[1]) * mark + 0.05 * fine
    b = base[2] + (pattern[2] - base[2]) * mark + 0.02 * fine
    return Spot(r * shade, g * shade, b * shade, 0.7, 0.02, 0.3, 0.12, 0.0)


@subroutine(fast=False)
def shoe(colors, x, y, z, pixel):
    """A leather shoe with a light sole."""
    floor = colors.floor
    shade = 1.0 + 0.14 * grain(x, y, z, 0.012, pixel) + 0.10 * grain(x, y, z, 0.005, pixel)
    sole = 1.0 - smoothstep(0.022 - 0.4 * pixel, 0.022 + 0.4 * pixel, y - floor)
    beside = abs(abs(x) - colors.legs[1, 0])
    laced = smoothstep(0.06, 0.07, y - floor) * (1.0 - smoothstep(0.022, 0.03, beside))
    lace = _band(z / 0.022, 0.35, pixel / 0.022) * laced
    r, g, b = colors.shoe[0], colors.shoe[1], colors.shoe[2]
    light = min(1.0, sole + 0.8 * lace)
    r, g, b = r + (0.55 - r) * light, g + (0.53 - g) * light, b + (0.48 - b) * light
    return Spot(r * shade, g * shade, b * shade, 0.5, 0.04, 0.15, 0.05, 0.0)


@subroutine(fast=False)
def sock(x, y, z, pixel):
    """A grey ribbed sock."""
    shade = 1.0 + 0.25 * grain(x, y * 0.2, z, 0.008, pixel)
    return Spot(0.25 * shade, 0.25 * shade, 0.27 * shade, 0.7, 0.02, 0.3, 0.1, 0.0)


@subroutine(fast=False)
def skirt(colors, u, v, x, y, z, pixel):
    """A skirt of panels with patches and bands; u is 0 to 1 once around, v metres downwards."""
    gore = _band(GORES / 2 * u, 0.5, pixel * GORES / 2 / (1.0 + 2.0 * v))
    bands = _band(v / 0.13, 0.22, pixel / 0.13)
    large = _patch(x + 3.0, y, z, 0.05, 0.62, pixel)
    small = _patch(x, y + 5.0, z, 0.023, 0.60, pixel)
    weave = 0.14 * grain(x, y, z, 0.010, pixel) + 0.10 * grain(x, y, z, 0.004, pixel)
    shade = 1.0 + weave + 0.12 * (2.0 * noise(x / 0.08, y / 0.08, z / 0.08) - 1.0)
    mark = gore + large - 2.0 * gore * large
    base, pattern, accent = colors.skirt[0], colors.skirt[1], colors.accent
    r = base[0] + (pattern[0] - base[0]) * mark
    g = base[1] + (pattern[1] - base[1]) * mark
    b = base[2] + (pattern[2] - base[2]) * mark
    part = max(bands, small)
    r, g, b = r + (accent[0] - r) * part, g + (accent[1] - g) * part, b + (accent[2] - b) * part
    return Spot(r * shade, g * shade, b * shade, 0.7, 0.02, 0.35, 0.12, 0.0)
