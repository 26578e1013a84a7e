"""Plain clothes: a knitted jumper, jeans and leather shoes."""

import math

from ico3d.splat.cpu.compile import subroutine
from ico3d.studio.picture.clothes.relief import RIBBED, TWILL, WALE, ribbed, stitch, twill
from ico3d.studio.picture.materials import Spot
from ico3d.studio.picture.textures import grain, noise, smoothstep, visible

THREAD = (0.42, 0.235, 0.085)
"""Albedo of the stitches on jeans."""
BETWEEN, MEAN_STITCH = 0.22, 0.52
"""How much darker wool is between stitches, and the mean height of a stitch, 0 to 1."""
FUZZ = 0.22
"""Light that the hairs of wool send back at grazing angles."""


@subroutine()
def jumper(colors, w, height, x, y, z, pixel):
    """Wool of one colour, darker between ribs and stitches, with fuzz.

    Args:
        colors: Colours of the person.
        w: The place, a `Weave`.
        height: Height of ribs and stitches there, metres.
        x: Place on the person at rest, metres.
        y: Place on the person at rest, metres.
        z: Place on the person at rest, metres.
        pixel: Size of a pixel on the surface, metres.
    """
    # Wool is never quite even: broad, faint clouds, too soft to look like a pattern.
    tone = 1.0 + 0.03 * grain(x, 0.6 * y, z, 0.05, pixel)
    rib = ribbed(w)
    seen = visible(WALE, 1.8 * pixel) * (1.0 - rib)
    # Stitches keep the mean tone: wool is as bright from far away as from near.
    tone *= 1.0 - seen * BETWEEN * (MEAN_STITCH - stitch(w.u, w.v, pixel))
    if rib > 0.0:
        tone *= 1.0 - rib * 0.16 * (1.0 - smoothstep(-0.0005, 0.9 * RIBBED, height))
    base = colors.jumper
    # Fine hairs scatter light within wool: it has no hard terminator, and glows at its rim.
    return Spot(base[0] * tone, base[1] * tone, base[2] * tone, 0.9, 0.010, 0.34, 0.0, FUZZ)


@subroutine()
def jeans(colors, w, x, y, z, pixel):
    """Indigo denim: a little paler on thighs, knees, seams and hems, sewn with a tan thread."""
    hip, ankle = colors.legs[0], colors.legs[1]
    down = (hip[1] - y) / (hip[1] - ankle[1])
    out = abs(x) - hip[0] - down * (ankle[0] - hip[0])
    behind = z - hip[2]
    turn = math.atan2(behind, out)
    front = max(0.0, math.sin(turn))
    thigh = math.exp(-(((down - 0.28) / 0.22) ** 2)) + 0.8 * math.exp(
        -(((down - 0.53) / 0.09) ** 2)
    )
    worn = 0.24 * thigh * front**1.5 + 0.05 * (noise(x / 0.05, y / 0.12, z / 0.05) - 0.5)
    worn += 0.10 * (1.0 - smoothstep(0.0, 0.012, w.seam)) + 0.08 * (
        1.0 - smoothstep(0.0, 0.3, w.hem)
    )
    # Yarn of uneven thickness draws long pale streaks.
    streak = grain(w.u * 4.0, w.v * 0.25, 0.0, 0.011, 0.6 * pixel)
    worn += 0.05 * streak + 0.03 * grain(x, y, z, 0.004, pixel)
    weave = visible(TWILL, 2.0 * pixel) * math.sin(twill(w.u, w.v))
    worn = min(1.0, max(0.0, 0.10 + worn + 0.07 * weave))
    dark, pale = colors.jeans[0], colors.jeans[1]
    r = dark[0] + (pale[0] - dark[0]) * worn
    g = dark[1] + (pale[1] - dark[1]) * worn
    b = dark[2] + (pale[2] - dark[2]) * worn
    radius = math.sqrt(out * out + behind * behind)
    side = abs(turn) * radius if abs(x) > 0.02 else 1.0
    side_seam = 1.0 - smoothstep(0.0008, 0.0008 + pixel, side)
    sewn = max(_sewn(w.seam, w.v, pixel), _sewn(side, w.v, pixel))
    sewn = max(sewn, _sewn(abs(w.hem * 0.022 - 0.017) + 0.004, 1.3 * w.u, pixel))
    sewn = max(sewn, _pocket(abs(x) - hip[0], y - hip[1], behind, pixel))
    shade = 1.0 - 0.3 * side_seam
    r, g, b = r * shade, g * shade, b * shade
    r, g, b = r + (THREAD[0] - r) * sewn, g + (THREAD[1] - g) * sewn, b + (THREAD[2] - b) * sewn
    return Spot(r, g, b, 0.75, 0.025, 0.18, 0.0, 0.05)


@subroutine()
def _sewn(away, along, pixel):
    """A row of stitches 4 mm beside a line, 0 to 1; fades where pixels are larger than thread."""
    line = 1.0 - smoothstep(0.0007, 0.0007 + pixel, abs(away - 0.004))
    gap = smoothstep(0.15, 0.3, abs(along / 0.0034 - math.floor(along / 0.0034) - 0.5))
    near = visible(0.003, pixel)
    return 0.5 * line * (near * gap + (1.0 - near) * 0.7) * min(1.0, 0.0022 / pixel)


@subroutine()
def _pocket(x, y, behind, pixel):
    """Two rows of stitches around a pocket on the back; x, y in metres from the hip's middle."""
    if behind > 0.0:
        return 0.0
    half = 0.058 - 0.06 * max(0.0, 0.03 - y)
    low = -0.075 - 0.018 * (1.0 - abs(x) / 0.06)
    edge = max(abs(x + 0.005) - half, low - y, y - 0.055)
    return max(
        _sewn(abs(edge) + 0.004, x + y, pixel), _sewn(abs(edge + 0.006) + 0.004, x + y, pixel)
    )


@subroutine()
def leather(colors, x, y, z, pixel):
    """A shoe of smooth leather, creased where the toes bend, on a dark stitched sole."""
    floor = colors.floor
    high = y - floor
    crease = noise(x / 0.02, y / 0.012, z / 0.006) * math.exp(-(((z - 0.055) / 0.022) ** 2))
    shade = 1.0 + 0.10 * grain(x, y, z, 0.014, pixel) + 0.08 * grain(x, y, z, 0.003, pixel)
    shade *= 1.0 - 0.35 * crease
    sole = 1.0 - smoothstep(0.020 - 0.4 * pixel, 0.020 + 0.4 * pixel, high)
    welt = (1.0 - smoothstep(0.0012, 0.0012 + pixel, abs(high - 0.0205))) * min(1.0, 0.002 / pixel)
    base = colors.leather
    r, g, b = base[0] * shade, base[1] * shade, base[2] * shade
    r, g, b = r + (0.030 - r) * sole, g + (0.026 - g) * sole, b + (0.022 - b) * sole
    r, g, b = r + (0.30 - r) * 0.6 * welt, g + (0.20 - g) * 0.6 * welt, b + (0.09 - b) * 0.6 * welt
    return Spot(r, g, b, 0.38 + 0.35 * sole, 0.045, 0.1, 0.03, 0.0)
