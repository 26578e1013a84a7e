"""What the lights of a studio give to a spot of a surface, in linear light.

A material calls `lit` with its `Spot`, or puts its own answer together: `seen_lamp` is the share of
a lamp that reaches the spot, `ambient` the light of the surroundings on a diffuse surface,
`mirrored` what a mirror would show, `diffuse` and `highlight` how a surface reflects one lamp.
"""

import math
from typing import NamedTuple

import numpy as np

from ico3d.splat.cpu.compile import kernel, subroutine
from ico3d.studio.picture.lamps import Lamps
from ico3d.studio.picture.shadows import Covered, Shadow, cast, seen

KEY, FILL, RIM = 0, 1, 2
"""Rows of the lamps."""
LOOKED_UP = (-1.0, -1.0)
"""Shares of key and rim light that are not known and come from the depth maps."""
OFF = 0.003
"""Metres off the surface at which shadows are looked up: grazing light shades no own triangle."""


class Lights(NamedTuple):
    """The lights of one frame in the person's canonical space.

    Attributes:
        directions: (3, 3) float32 rows: unit vectors towards key, fill and rim light.
        colors: (3, 3) float32 linear RGB.
        sizes: (3,) float32 tangents of half the angles under which the lamps are seen.
        turn: (3, 3) float32 rotation from canonical space to the world.
        harmonics: (9, 3) float32 `Lamps.harmonics`.
        key: Depth map of the key light.
        rim: Depth map of the rim light.
    """

    directions: np.ndarray
    colors: np.ndarray
    sizes: np.ndarray
    turn: np.ndarray
    harmonics: np.ndarray
    key: Shadow
    rim: Shadow


def lights_on(
    vertices: np.ndarray,
    faces: np.ndarray,
    solid: np.ndarray,
    world_from_head: np.ndarray,
    lamps: Lamps,
    covered: Covered,
) -> Lights:
    """The studio's lights for one frame.

    Args:
        vertices: (V, 3) float32 posed, canonical head space.
        faces: (F, 3) int32.
        solid: (N,) int32 the faces that cast shadows.
        world_from_head: (4, 4) pose of the head.
        lamps: How the studio is lit.
        covered: The region in which shadows are computed.
    """
    rotation = world_from_head[:3, :3]
    towards = lamps.towards @ rotation  # rows: Rᵀ·direction
    centre = covered.centre
    if covered.whole:
        centre = (centre - world_from_head[:3, 3]) @ rotation
    key, rim = (
        cast(vertices, faces, solid, towards[i], float(lamps.sizes[i]), covered, centre)
        for i in (KEY, RIM)
    )
    return Lights(
        directions=towards.astype(np.float32),
        colors=lamps.colors.astype(np.float32),
        sizes=lamps.sizes.astype(np.float32),
        turn=rotation.astype(np.float32),
        harmonics=lamps.harmonics().astype(np.float32),
        key=key,
        rim=rim,
    )


@subroutine()
def seen_lamp(lights, lamp, p, n, occlusion):
    """Share of a lamp that reaches a point with a normal, 0 to 1.

    Args:
        lights: Lights of the frame.
        lamp: `KEY`, `FILL` or `RIM`.
        p: Position (3), metres.
        n: Unit normal (3) of the mesh, without relief.
        occlusion: Visible share of the sky; stands in for the shadow of the wide fill light, and
            darkens creases that are too fine for a depth map.
    """
    if lamp == FILL:
        return min(1.0, 1.5 * occlusion)
    x, y, z = p[0] + OFF * n[0], p[1] + OFF * n[1], p[2] + OFF * n[2]
    crease = min(1.0, 0.35 + 1.3 * occlusion)
    if lamp == KEY:
        return crease * seen(lights.key, x, y, z, n[0], n[1], n[2])
    return crease * seen(lights.rim, x, y, z, n[0], n[1], n[2])


@kernel()
def ambient(lights, n):
    """Light (3) of the surroundings on a diffuse surface with unit normal n that sees them all."""
    turn, h = lights.turn, lights.harmonics
    x = turn[0, 0] * n[0] + turn[0, 1] * n[1] + turn[0, 2] * n[2]
    y = turn[1, 0] * n[0] + turn[1, 1] * n[1] + turn[1, 2] * n[2]
    z = turn[2, 0] * n[0] + turn[2, 1] * n[1] + turn[2, 2] * n[2]
    b1, b2, b3 = 0.488603 * y, 0.488603 * z, 0.488603 * x
    b4, b5, b6 = 1.092548 * x * y, 1.092548 * y * z, 0.315392 * (3.0 * z * z - 1.0)
    b7, b8 = 1.092548 * x * z, 0.546274 * (x * x - y * y)
    return (
        _series(h, 0, b1, b2, b3, b4, b5, b6, b7, b8),
        _series(h, 1, b1, b2, b3, b4, b5, b6, b7, b8),
        _series(h, 2, b1, b2, b3, b4, b5, b6, b7, b8),
    )


@subroutine()
def _series(h, c, b1, b2, b3, b4, b5, b6, b7, b8):
    first = 0.282095 * h[0, c] + b1 * h[1, c] + b2 * h[2, c] + b3 * h[3, c] + b4 * h[4, c]
    return max(0.0, first + b5 * h[5, c] + b6 * h[6, c] + b7 * h[7, c] + b8 * h[8, c])


@subroutine()
def mirrored(lights, direction, blur):
    """Light (3) that a mirror sees in a unit direction: the lamps as soft discs in the room.

    Args:
        lights: Lights of the frame.
        direction: (3) unit vector.
        blur: Tangent by which the lamps' edges are blurred.
    """
    r, g, b = ambient(lights, direction)
    for i in range(3):
        to = lights.directions[i]
        cosine = direction[0] * to[0] + direction[1] * to[1] + direction[2] * to[2]
        if cosine <= 0.0:
            continue
        off = math.sqrt(max(0.0, 1.0 - cosine * cosine)) / cosine
        size = lights.sizes[i]
        edge = min(1.0, max(0.0, (size + blur - off) / (2.0 * blur + 1e-3)))
        # A lamp of this size that gives unit light has this radiance, over π.
        glow = edge / ((size + 0.5 * blur) ** 2 + 1e-4)
        r, g, b = (
            r + glow * lights.colors[i, 0],
            g + glow * lights.colors[i, 1],
            b + glow * lights.colors[i, 2],
        )
    return r, g, b


@subroutine()
def unoccluded(occlusion, albedo):
    """Ambient light that arrives where a share of the sky is hidden by a surface of this albedo.

    Light that is reflected between surfaces brightens creases in their own colour (Jiménez et al.,
    "Practical real-time strategies for accurate indirect occlusion").
    """
    a = 2.0404 * albedo - 0.3324
    b = -4.7951 * albedo + 0.6417
    c = 2.7552 * albedo + 0.6903
    return max(occlusion, ((occlusion * a + b) * occlusion + c) * occlusion)


@subroutine()
def diffuse(cosine, scatter):
    """Diffuse light that reaches past the terminator by `scatter`, as in skin; energy is kept."""
    value = max(0.0, (cosine + scatter) / (1.0 + scatter))
    return value / (1.0 + scatter)


@subroutine()
def highlight(n_dot_h, n_dot_l, l_dot_h, roughness, facing, size):
    """Highlight of a lamp: GGX, widened by the lamp's size; `facing` is the frontal reflectance."""
    if n_dot_l <= 0.0 or n_dot_h <= 0.0:
        return 0.0
    sharp = roughness * roughness
    alpha = min(1.0, sharp + 0.5 * size)
    d = n_dot_h * n_dot_h * (alpha * alpha - 1.0) + 1.0001
    fresnel = facing + (1.0 - facing) * (1.0 - max(0.0, l_dot_h)) ** 5
    spread = alpha * alpha / (4.0 * d * d * max(0.1, l_dot_h * l_dot_h) * (roughness + 0.5))
    return fresnel * spread * n_dot_l


@subroutine()
def lit(spot, lights, n, v, p, smooth, occlusion, known):
    """Linear light (3) that a spot sends to the eye.

    Args:
        spot: What the surface is made of, a `Spot`.
        lights: Lights of the frame.
        n: Unit normal (3), with relief.
        v: Unit vector (3) towards the eye.
        p: Position (3), metres.
        smooth: Unit normal (3) of the mesh, without relief.
        occlusion: Visible share of the sky.
        known: Shares of key and rim light that the spot sees, or `LOOKED_UP`.
    """
    nx, ny, nz = n
    red, green, blue = ambient(lights, n)
    facing_eye = max(0.0, nx * v[0] + ny * v[1] + nz * v[2])
    rim = (1.0 - facing_eye) ** 4
    fuzz_red, fuzz_green, fuzz_blue = (
        spot.sheen * rim * (0.3 + spot.red),
        spot.sheen * rim * (0.3 + spot.green),
        spot.sheen * rim * (0.3 + spot.blue),
    )
    r = red * (spot.red * unoccluded(occlusion, spot.red) + fuzz_red * occlusion)
    g = green * (spot.green * unoccluded(occlusion, spot.green) + fuzz_green * occlusion)
    b = blue * (spot.blue * unoccluded(occlusion, spot.blue) + fuzz_blue * occlusion)
    if spot.facing > 0.0:
        # What a rough mirror shows of the room, at the strength of its frontal reflectance.
        c = 2.0 * facing_eye
        mr, mg, mb = ambient(lights, (c * nx - v[0], c * ny - v[1], c * nz - v[2]))
        gloss = occlusion * (spot.facing + (1.0 - spot.roughness) * 0.3 * rim)
        r, g, b = r + gloss * mr, g + gloss * mg, b + gloss * mb
    for i in range(3):
        to = lights.directions[i]
        cosine = nx * to[0] + ny * to[1] + nz * to[2]
        if cosine <= -spot.scatter:
            continue
        # Relief does not catch light that comes from behind the surface.
        level = smooth[0] * to[0] + smooth[1] * to[1] + smooth[2] * to[2]
        risen = min(1.0, max(0.0, (level + spot.scatter) / 0.35))
        if risen <= 0.0:
            continue
        if i == FILL or known[0] < 0.0:
            reach = risen * seen_lamp(lights, i, p, smooth, occlusion)
        else:
            reach = risen * known[0 if i == KEY else 1]
        if reach <= 0.0:
            continue
        shine = 0.0
        hx, hy, hz = to[0] + v[0], to[1] + v[1], to[2] + v[2]
        s = 1.0 / max(1e-6, math.sqrt(hx * hx + hy * hy + hz * hz))
        if spot.facing > 0.0:
            shine = highlight(
                s * (nx * hx + ny * hy + nz * hz),
                cosine,
                s * (to[0] * hx + to[1] * hy + to[2] * hz),
                spot.roughness,
                spot.facing,
                lights.sizes[i],
            )
        glow = diffuse(cosine, 0.4)
        far, near = diffuse(cosine, spot.scatter), diffuse(cosine, 0.6 * spot.scatter)
        r += reach * lights.colors[i, 0] * (spot.red * far + shine + fuzz_red * glow)
        g += reach * lights.colors[i, 1] * (spot.green * near + shine + fuzz_green * glow)
        b += reach * lights.colors[i, 2] * (spot.blue * near + shine + fuzz_blue * glow)
    return r, g, b
