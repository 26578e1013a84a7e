"""Skin: pores, creases and colours of a face, and light that goes in, spreads and comes out."""

import math
from typing import NamedTuple

from ico3d.splat.cpu.compile import subroutine
from ico3d.studio.picture.hands import line_depth, nail_share
from ico3d.studio.picture.lighting import ambient, diffuse, highlight, seen_lamp, unoccluded
from ico3d.studio.picture.textures import grain, noise, slope, smoothstep, spots, visible

SPREAD = (0.35, 0.22, 0.16)
"""How far red, green and blue light spread past the terminator, as cosines: red goes deepest."""
BLEED = (0.84, 1.02, 1.06)
"""Exponents that widen half shadows for red light and narrow them for green and blue light."""
CALM = (0.75, 0.35, 0.15)
"""Share of relief that red, green and blue light do not see, because they spread below it."""
SHARP = 0.55
"""Roughness of the second, sharper highlight relative to the first."""
FACING = 0.028
"""Reflectance of skin at frontal view."""


class Skin(NamedTuple):
    """Properties of skin at one point.

    Attributes:
        red: Albedo, linear, red.
        green: Albedo, linear, green.
        blue: Albedo, linear, blue.
        roughness: Of the broad highlight, 0 to 1.
        oil: Weight of the sharp highlight, 0 to 1.
        gloss: Factor of the reflectance: 1 for dry skin, more for wet lips, 0 under hair.
    """

    red: float
    green: float
    blue: float
    roughness: float
    oil: float
    gloss: float


@subroutine()
def skin_at(colors, channels, x, y, z, pixel):
    """The `Skin` of a face at a place at rest: flush, freckles, veins, beard, roots, lips."""
    lip, red, freckle, beard, scalp = channels[:5]
    large, small = grain(x, y, z, 0.024, pixel), grain(x + 2.0, y, z, 0.007, pixel)
    fine = grain(x, y, z, 0.0021, pixel)
    # Melanin darkens all, blue most; blood takes green and blue.
    melanin = 1.0 + 0.05 * large + 0.05 * small + 0.05 * fine
    patch = grain(x + 5.0, y, z, 0.013, pixel) + 0.6 * grain(x + 9.0, y, z, 0.004, pixel)
    blood = 0.36 * max(0.0, red) * (1.0 + 0.35 * patch) + 0.05 * (patch + 0.4)
    sallow = max(0.0, -red)
    r = colors.skin[0] * melanin * (1.0 - 0.05 * blood) * (1.0 - 0.13 * sallow)
    g = colors.skin[1] * melanin**1.25 * (1.0 - 0.44 * blood) * (1.0 - 0.08 * sallow)
    b = colors.skin[2] * melanin**1.5 * (1.0 - 0.42 * blood) * (1.0 - 0.12 * sallow)
    dots = spots(x, y, z, 0.0036, pixel) + 0.8 * spots(x + 1.0, y, z, 0.0023, pixel)
    dots += 0.7 * spots(x + 4.0, y, z, 0.0060, pixel)
    dots = min(1.0, dots) * colors.freckles * (0.08 + freckle)
    r, g, b = r * (1.0 - 0.22 * dots), g * (1.0 - 0.40 * dots), b * (1.0 - 0.50 * dots)
    shadow = colors.stubble * beard
    if shadow > 0.0:
        shadow *= 0.75 + 0.5 * noise(x / 0.0009, y / 0.0009, z / 0.0009)
        r, g, b = r * (1.0 - 0.50 * shadow), g * (1.0 - 0.42 * shadow), b * (1.0 - 0.32 * shadow)
    roots = 0.0
    if scalp > 0.0:
        roots = min(1.0, 0.95 * scalp * (0.96 + 0.08 * noise(x / 0.0011, y / 0.0011, z / 0.0011)))
        r += (0.7 * colors.hair[0] - r) * roots
        g += (0.7 * colors.hair[1] - g) * roots
        b += (0.7 * colors.hair[2] - b) * roots
    edge = 0.0
    if lip > 0.0:
        edge = 0.92 * smoothstep(0.0, 1.0, lip + 0.10 * small)
        tint = 1.0 + 0.10 * grain(x * 3.0, y * 0.6, z, 0.0024, pixel) + 0.07 * small
        r += (colors.lips[0] * tint - r) * edge
        g += (colors.lips[1] * tint - g) * edge
        b += (colors.lips[2] * tint - b) * edge
    oil = 0.16 + 0.16 * freckle + 0.08 * large
    return Skin(
        r,
        g,
        b,
        0.54 + 0.04 * small - 0.10 * edge,
        oil + (0.55 - oil) * edge,
        (0.9 + 0.35 * edge + 0.10 * fine) * (1.0 - 0.9 * roots),
    )


@subroutine()
def handed(skin, lines, nails, rest, pixel):
    """The `Skin` of a hand with its lines and nails, and how much of the light gets into lines."""
    x, y, z = rest
    nail, away = nail_share(nails, x, y, z, pixel)
    if nail > 0.0:
        # A pale edge of keratin, pink flesh under the rest of it.
        pale = 0.10 * smoothstep(0.7, 1.0, away)
        return (
            Skin(
                skin.red * (1.0 + nail * (0.04 + pale)),
                skin.green * (1.0 + nail * (pale - 0.06)),
                skin.blue * (1.0 + nail * (pale - 0.03)),
                skin.roughness * (1.0 - 0.45 * nail),
                skin.oil + (0.8 - skin.oil) * nail,
                skin.gloss * (1.0 + 0.5 * nail),
            ),
            1.0 - 0.25 * nail * smoothstep(0.85, 1.0, away),
        )
    depth = line_depth(lines, x, y, z, pixel)
    return (
        Skin(
            skin.red * (1.0 - 0.20 * depth),
            skin.green * (1.0 - 0.38 * depth),
            skin.blue * (1.0 - 0.40 * depth),
            skin.roughness,
            skin.oil * (1.0 - depth),
            skin.gloss * (1.0 - 0.5 * depth),
        ),
        1.0 - 0.35 * depth,
    )


@subroutine()
def relieved(n, lip, x, y, z, pixel):
    """The unit normal (3) with pores and fine lines, and how much of the light gets into pores."""
    gx, gy, gz, hollow = 0.0, 0.0, 0.0, 0.0
    size = 0.0020
    for _ in range(3):
        fade = visible(size, pixel)
        if fade > 0.0:
            value, sx, sy, sz = slope(x / size, y / size, z / size)
            # Pits are narrower than the skin between them.
            pit = fade * smoothstep(0.45, 0.75, value)
            amount = 0.030 * fade + 0.100 * pit
            gx, gy, gz = gx + amount * sx, gy + amount * sy, gz + amount * sz
            hollow += 0.035 * pit
        size *= 0.45
    if lip > 0.05:
        fade = visible(0.0011, pixel) * smoothstep(0.05, 0.6, lip)
        value, sx, sy, sz = slope(x / 0.0011, y / 0.0075, z / 0.0050)
        gx += 0.30 * fade * sx
        hollow += 0.14 * fade * smoothstep(0.55, 0.85, value)
    along = gx * n[0] + gy * n[1] + gz * n[2]
    nx, ny, nz = (
        n[0] + gx - along * n[0],
        n[1] + gy - along * n[1],
        n[2] + gz - along * n[2],
    )
    length = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    return (nx * length, ny * length, nz * length), 1.0 - hollow


@subroutine()
def lit_skin(skin, lights, n, v, p, smooth, occlusion):
    """Linear light (3) that skin sends to the eye.

    Light of longer waves goes farther under the surface: red sees less relief, reaches past the
    terminator and bleeds into the edges of shadows (as in pre-integrated skin shading, Penner).

    Args:
        skin: A `Skin`.
        lights: Lights of the frame.
        n: Unit normal (3) with relief.
        v: Unit vector (3) towards the eye.
        p: Position (3), metres.
        smooth: Unit normal (3) of the mesh.
        occlusion: Visible share of the sky.
    """
    facing = max(0.0, n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
    ar, ag, ab = ambient(lights, smooth)
    # Where hardly any light comes in, none has a way on: deep in a cuff skin is dark, not red.
    through = 0.2 * smoothstep(0.1, 0.5, occlusion)
    r = skin.red * ar * unoccluded(occlusion ** (1.0 - through), skin.red)
    g = skin.green * ag * unoccluded(occlusion, skin.green)
    b = skin.blue * ab * unoccluded(occlusion, skin.blue)
    f0 = FACING * skin.gloss
    grazing = (1.0 - facing) ** 5
    c = 2.0 * facing
    mr, mg, mb = ambient(lights, (c * n[0] - v[0], c * n[1] - v[1], c * n[2] - v[2]))
    mirror = occlusion * (f0 + 0.22 * skin.gloss * (1.0 - skin.roughness) * grazing)
    r, g, b = r + mirror * mr, g + mirror * mg, b + mirror * mb
    for i in range(3):
        to = lights.directions[i]
        flat = smooth[0] * to[0] + smooth[1] * to[1] + smooth[2] * to[2]
        cosine = n[0] * to[0] + n[1] * to[1] + n[2] * to[2]
        if flat <= -SPREAD[0] and cosine <= 0.0:
            continue
        reach = seen_lamp(lights, i, p, smooth, occlusion)
        if reach <= 0.0:
            continue
        hx, hy, hz = to[0] + v[0], to[1] + v[1], to[2] + v[2]
        s = 1.0 / max(1e-6, math.sqrt(hx * hx + hy * hy + hz * hz))
        n_dot_h = s * (n[0] * hx + n[1] * hy + n[2] * hz)
        l_dot_h = s * (to[0] * hx + to[1] * hy + to[2] * hz)
        size = lights.sizes[i]
        broad = highlight(n_dot_h, cosine, l_dot_h, skin.roughness, f0, size)
        sharp = highlight(n_dot_h, cosine, l_dot_h, SHARP * skin.roughness, f0, size)
        shine = reach * min(1.0, skin.gloss) * (broad + skin.oil * (sharp - broad))
        lr = diffuse(cosine + CALM[0] * (flat - cosine), SPREAD[0])
        lg = diffuse(cosine + CALM[1] * (flat - cosine), SPREAD[1])
        lb = diffuse(cosine + CALM[2] * (flat - cosine), SPREAD[2])
        r += lights.colors[i, 0] * (reach ** BLEED[0] * skin.red * lr + shine)
        g += lights.colors[i, 1] * (reach ** BLEED[1] * skin.green * lg + shine)
        b += lights.colors[i, 2] * (reach ** BLEED[2] * skin.blue * lb + shine)
    return r, g, b
