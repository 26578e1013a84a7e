"""Deferred shading: colours samples whose triangle the rasteriser has found."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from ico3d.studio.person.subject import Material
from ico3d.studio.picture import garments
from ico3d.studio.picture import materials as paints
from ico3d.studio.picture.lighting import gloss, key_visibility, wrapped
from ico3d.studio.picture.materials import Spot
from ico3d.studio.picture.textures import noise, smoothstep, strands

SKIN, MOUTH, EYE = int(Material.SKIN), int(Material.MOUTH), int(Material.EYE)
TEETH, GUMS, TONGUE = int(Material.TEETH), int(Material.GUMS), int(Material.TONGUE)
HAIR, CLOTH, BROW = int(Material.HAIR), int(Material.CLOTH), int(Material.BROW)
TROUSERS, SHOE, SOCK = int(Material.TROUSERS), int(Material.SHOE), int(Material.SOCK)
SKIRT = int(Material.SKIRT)


MOUTH_DEPTH = 0.026
"""Distance in metres behind the lips over which light in the mouth falls to 1/e."""


class Scene(NamedTuple):
    """One posed person as arrays for the shader.

    Attributes:
        faces: (F, 3) int32.
        materials: (F,) uint8.
        corner_uv: (F, 3, 2) float32.
        rest: (V, 3) float32 neutral vertices, at which textures are evaluated, metres.
        vertices: (V, 3) float32 posed vertices, canonical head space, metres.
        normals: (V, 3) float32.
        channels: (V, 6) float32 `Paint.channels`.
        strands: (V, 4) float32 `Paint.strands`.
        occlusion: (V,) float32 `Paint.occlusion_at` of this frame.
        eyes: (2, 7) float32 left and right eye: centre (3), axis (3), iris radius, metres.
    """

    faces: np.ndarray
    materials: np.ndarray
    corner_uv: np.ndarray
    rest: np.ndarray
    vertices: np.ndarray
    normals: np.ndarray
    channels: np.ndarray
    strands: np.ndarray
    occlusion: np.ndarray
    eyes: np.ndarray


@njit(cache=True, nogil=True)
def _weights(screen, faces, f, v, w):
    """Perspective-correct weights of the corners from screen-space ones."""
    a = (1.0 - v - w) * screen[faces[f, 0], 2]
    b = v * screen[faces[f, 1], 2]
    c = w * screen[faces[f, 2], 2]
    total = 1.0 / (a + b + c)
    return a * total, b * total, c * total


@njit(cache=True, nogil=True)
def _mix3(values, faces, f, a, b, c):
    """Interpolates a (V, 3) attribute."""
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    return (
        a * values[i, 0] + b * values[j, 0] + c * values[k, 0],
        a * values[i, 1] + b * values[j, 1] + c * values[k, 1],
        a * values[i, 2] + b * values[j, 2] + c * values[k, 2],
    )


@njit(cache=True, nogil=True)
def _unit(x, y, z):
    length = 1.0 / max(1e-12, math.sqrt(x * x + y * y + z * z))
    return x * length, y * length, z * length


@njit(cache=True, nogil=True)
def _uv(corner_uv, f, a, b, c):
    uv = corner_uv[f]
    return (
        a * uv[0, 0] + b * uv[1, 0] + c * uv[2, 0],
        a * uv[0, 1] + b * uv[1, 1] + c * uv[2, 1],
    )


@njit(cache=True, nogil=True)
def _strand(scene, f, a, b, c):
    """Unit vector along the strands, and units of u per metre."""
    i, j, k = scene.faces[f, 0], scene.faces[f, 1], scene.faces[f, 2]
    s = scene.strands
    x, y, z = _unit(
        a * s[i, 0] + b * s[j, 0] + c * s[k, 0],
        a * s[i, 1] + b * s[j, 1] + c * s[k, 1],
        a * s[i, 2] + b * s[j, 2] + c * s[k, 2],
    )
    return x, y, z, a * s[i, 3] + b * s[j, 3] + c * s[k, 3]


@njit(cache=True, nogil=True)
def _painted(scene, f, a, b, c):
    """The six channels of `Paint` at a spot."""
    i, j, k = scene.faces[f, 0], scene.faces[f, 1], scene.faces[f, 2]
    ch = scene.channels
    return (
        a * ch[i, 0] + b * ch[j, 0] + c * ch[k, 0],
        a * ch[i, 1] + b * ch[j, 1] + c * ch[k, 1],
        a * ch[i, 2] + b * ch[j, 2] + c * ch[k, 2],
        a * ch[i, 3] + b * ch[j, 3] + c * ch[k, 3],
        a * ch[i, 4] + b * ch[j, 4] + c * ch[k, 4],
        a * ch[i, 5] + b * ch[j, 5] + c * ch[k, 5],
    )


@njit(cache=True, nogil=True)
def display(value):
    """Converts linear light to a display value in [0, 1]: a soft shoulder, then the sRGB curve."""
    if value > 0.6:
        value = 0.6 + 0.4 * (1.0 - math.exp(-(value - 0.6) / 0.4))
    if value <= 0.0031308:
        return 12.92 * max(0.0, value)
    return 1.055 * value ** (1.0 / 2.4) - 0.055


@njit(cache=True, nogil=True)
def _lit(spot, lights, n, v, p, occlusion):
    """Linear light (3) that a spot sends to the eye."""
    nx, ny, nz = n
    o = 0.003  # metres off the surface: grazing light does not shade its own triangle
    up = 0.5 + 0.5 * (nx * lights.up[0] + ny * lights.up[1] + nz * lights.up[2])
    bounce = 0.10 * (1.0 - occlusion) * (0.3 + occlusion)  # folds glow in their own colour
    ambient_r = occlusion * (lights.ground[0] * (1 - up) + lights.sky[0] * up) + 1.3 * bounce
    ambient_g = occlusion * (lights.ground[1] * (1 - up) + lights.sky[1] * up) + 0.6 * bounce
    ambient_b = occlusion * (lights.ground[2] * (1 - up) + lights.sky[2] * up) + 0.5 * bounce
    r, g, b = spot.red * ambient_r, spot.green * ambient_g, spot.blue * ambient_b
    for i in range(3):
        lx, ly, lz = lights.directions[i]
        cosine = nx * lx + ny * ly + nz * lz
        reach = min(1.0, 1.6 * occlusion)
        if i == 0:
            reach = key_visibility(lights, p[0] + o * nx, p[1] + o * ny, p[2] + o * nz) * min(
                1.0, 0.35 + 1.3 * occlusion
            )
        hx, hy, hz = _unit(lx + v[0], ly + v[1], lz + v[2])
        shine = 0.0
        if spot.facing > 0.0:
            shine = gloss(
                nx * hx + ny * hy + nz * hz,
                cosine,
                v[0] * hx + v[1] * hy + v[2] * hz,
                spot.power,
                spot.facing,
            )
        red = wrapped(cosine, spot.wrap)
        other = wrapped(cosine, 0.6 * spot.wrap)
        r += reach * lights.colors[i, 0] * (spot.red * red + shine)
        g += reach * lights.colors[i, 1] * (spot.green * other + shine)
        b += reach * lights.colors[i, 2] * (spot.blue * other + shine)
    return r, g, b


@njit(cache=True, nogil=True)
def _strand_shine(lights, tangent, v, p, shift, occlusion):
    """Two highlights of light on strands (Kajiya-Kay), white one and tinted one."""
    white, tinted = 0.0, 0.0
    for i in range(3):
        reach = min(1.0, 0.3 + occlusion)
        if i == 0:
            reach *= key_visibility(lights, p[0], p[1], p[2])
        lx, ly, lz = lights.directions[i]
        hx, hy, hz = _unit(lx + v[0], ly + v[1], lz + v[2])
        along = tangent[0] * hx + tangent[1] * hy + tangent[2] * hz
        first, second = along + 0.09 + shift, along - 0.14 + shift
        strength = reach * lights.colors[i, 1]
        white += strength * max(0.0, 1.0 - first * first) ** 60.0
        tinted += strength * max(0.0, 1.0 - second * second) ** 16.0
    return white, tinted


@njit(cache=True, nogil=True)
def _eye_at(scene, rest):
    """Index of the eye, distance from its axis, angle about it, and the cornea's normal."""
    side = 0 if rest[0] > 0.0 else 1
    e = scene.eyes[side]
    dx, dy, dz = rest[0] - e[0], rest[1] - e[1], rest[2] - e[2]
    along = dx * e[3] + dy * e[4] + dz * e[5]
    px, py, pz = dx - along * e[3], dy - along * e[4], dz - along * e[5]
    radius = math.sqrt(px * px + py * py + pz * pz)
    bulge = 1.0 - smoothstep(0.9 * e[6], 1.25 * e[6], radius)
    forward = 0.45 * bulge * math.sqrt(dx * dx + dy * dy + dz * dz)
    n = _unit(dx - forward * e[3], dy - forward * e[4], dz - forward * e[5])
    return radius, math.atan2(py, px), e[6], n


@njit(cache=True, nogil=True)
def _spot(scene, colors, f, a, b, c, rest, pixel):
    """What the surface is made of at one spot."""
    material = scene.materials[f]
    x, y, z = rest
    if material == TROUSERS:
        return garments.trousers(colors, x, y, z, pixel)
    if material == SHOE:
        return garments.shoe(colors, x, y, z, pixel)
    if material == SOCK:
        return garments.sock(x, y, z, pixel)
    if material == SKIRT:
        u, v = _uv(scene.corner_uv, f, a, b, c)
        return garments.skirt(colors, u, v, x, y, z, pixel)
    if material == CLOTH:
        if colors.bold:
            return garments.printed(colors, x, y, z, pixel)
        u, v = _uv(scene.corner_uv, f, a, b, c)
        return paints.cloth(colors, u, v, x, y, z, pixel)
    if material == TEETH:
        return paints.teeth(x, y, z, pixel)
    if material == GUMS:
        return paints.flesh(0.42, 0.15, 0.14, x, y, z, pixel)
    if material == TONGUE:
        return paints.flesh(0.46, 0.18, 0.16, x, y, z, pixel)
    if material == MOUTH:
        return paints.flesh(0.34, 0.11, 0.10, x, y, z, pixel)
    values = _painted(scene, f, a, b, c)
    return paints.skin(colors, values, x, y, z, pixel)


@njit(cache=True, nogil=True)
def _shade_one(scene, colors, lights, f, a, b, c, camera, pixel):
    """Linear light (3) from one spot of a solid face."""
    rest = _mix3(scene.rest, scene.faces, f, a, b, c)
    p = _mix3(scene.vertices, scene.faces, f, a, b, c)
    n = _mix3(scene.normals, scene.faces, f, a, b, c)
    n = _unit(n[0], n[1], n[2])
    v = _unit(camera[0] - p[0], camera[1] - p[1], camera[2] - p[2])
    if n[0] * v[0] + n[1] * v[1] + n[2] * v[2] < -0.2:
        n = (-n[0], -n[1], -n[2])
    i, j, k = scene.faces[f, 0], scene.faces[f, 1], scene.faces[f, 2]
    occlusion = a * scene.occlusion[i] + b * scene.occlusion[j] + c * scene.occlusion[k]
    material = scene.materials[f]
    if material == EYE:
        radius, angle, iris, n = _eye_at(scene, rest)
        spot = paints.eye(colors, radius, angle, iris, rest[0], rest[1], rest[2], pixel)
        return _lit(spot, lights, n, v, p, occlusion)
    if material == HAIR:
        tx, ty, tz, per_metre = _strand(scene, f, a, b, c)
        uv = _uv(scene.corner_uv, f, a, b, c)
        spot = paints.hair(colors, uv[0], uv[1], rest[0], rest[1], rest[2], pixel * per_metre)
        shift = 0.10 * strands(uv[0], uv[1], 260.0, pixel * per_metre)
        white, tinted = _strand_shine(lights, (tx, ty, tz), v, p, shift, occlusion)
        r, g, bl = _lit(spot, lights, n, v, p, occlusion)
        return (
            r + 0.022 * white + 0.9 * tinted * colors.hair[0],
            g + 0.020 * white + 0.9 * tinted * colors.hair[1],
            bl + 0.018 * white + 0.9 * tinted * colors.hair[2],
        )
    spot = _spot(scene, colors, f, a, b, c, rest, pixel)
    tilt = spot.bump * min(1.0, max(0.0, 0.0016 / pixel - 1.0))
    if tilt > 0.0:
        s = 1.0 / 0.0013
        q = (rest[0] * s, rest[1] * s, rest[2] * s)
        n = _unit(
            n[0] + tilt * (2.0 * noise(q[0], q[1], q[2]) - 1.0),
            n[1] + tilt * (2.0 * noise(q[0] + 31.0, q[1], q[2]) - 1.0),
            n[2] + tilt * (2.0 * noise(q[0], q[1] + 57.0, q[2]) - 1.0),
        )
    if material in (SKIN, CLOTH, TROUSERS, SHOE, SOCK, SKIRT):
        return _lit(spot, lights, n, v, p, occlusion)
    inward = math.exp(-_painted(scene, f, a, b, c)[5] / MOUTH_DEPTH)
    r, g, bl = _lit(spot, lights, n, v, p, (0.35 + 0.65 * occlusion) * inward)
    # Deep in the mouth, light has been red-tinted by lips and cheeks.
    return r * (0.25 + 0.75 * inward), g * inward**1.4, bl * inward**1.6


@njit(cache=True, nogil=True)
def shade(scene, colors, lights, screen, triangle, barycentric, camera, pixel, out):
    """Colours the samples of solid faces.

    Args:
        scene: The posed person.
        colors: Colours of the person.
        lights: Lights of the frame.
        screen: (V, 3) float32 from `to_screen`.
        triangle: (H, W) int32 from `rasterise`.
        barycentric: (H, W, 2) float32 from `rasterise`.
        camera: (3,) the camera's centre in canonical head space.
        pixel: Size of a pixel at the head, metres.
        out: (H, W, 4) float32 display RGB and alpha, premultiplied; changed where covered.
    """
    height, width = triangle.shape
    for y in range(height):
        for x in range(width):
            f = triangle[y, x]
            if f < 0:
                continue
            v, w = barycentric[y, x, 0], barycentric[y, x, 1]
            a, b, c = _weights(screen, scene.faces, f, v, w)
            r, g, bl = _shade_one(scene, colors, lights, f, a, b, c, camera, pixel)
            out[y, x, 0], out[y, x, 1] = display(r), display(g)
            out[y, x, 2], out[y, x, 3] = display(bl), 1.0


@njit(cache=True, nogil=True)
def _card_alpha(material, u, v, pixel_u):
    """How much of a card of brow or lash hairs covers what is behind."""
    if material == BROW:
        ends = smoothstep(0.0, 0.14, u) * (1.0 - smoothstep(0.72, 1.0, u))
        edge = smoothstep(0.0, 0.38, v) * (1.0 - smoothstep(0.55, 1.0, v))
        hairs = 0.72 + 0.55 * strands(u + 0.12 * v, v, 80.0, pixel_u)
        return min(1.0, max(0.0, ends * edge * hairs * 1.1))
    fibre = 0.9 + 0.9 * strands(u + 0.05 * v, 0.0, 110.0, pixel_u)
    thick = 0.35 if u > 1.5 else 1.2
    return min(1.0, max(0.0, thick * fibre * (1.0 - v) ** 1.3))


@njit(cache=True, nogil=True)
def shade_cards(
    scene, colors, lights, screen, nearest, triangle, barycentric, solid, camera, pixel, out
):
    """Draws brows and lashes over the picture that `shade` has drawn.

    Args:
        scene: The posed person.
        colors: Colours of the person.
        lights: Lights of the frame.
        screen: (V, 3) float32 from `to_screen`.
        nearest: (H, W) float32 nearness of the cards, from `rasterise`.
        triangle: (H, W) int32 triangles of the cards, from `rasterise`.
        barycentric: (H, W, 2) float32 of the cards, from `rasterise`.
        solid: (H, W) float32 nearness of the solid faces, which hide cards behind them.
        camera: (3,) the camera's centre in canonical head space.
        pixel: Size of a pixel at the head, metres.
        out: (H, W, 4) float32 display RGB and alpha, premultiplied; changed where cards cover it.
    """
    height, width = triangle.shape
    for y in range(height):
        for x in range(width):
            f = triangle[y, x]
            if f < 0 or nearest[y, x] * 1.003 < solid[y, x]:
                continue
            v, w = barycentric[y, x, 0], barycentric[y, x, 1]
            a, b, c = _weights(screen, scene.faces, f, v, w)
            uv = _uv(scene.corner_uv, f, a, b, c)
            per_metre = _strand(scene, f, a, b, c)[3]
            alpha = _card_alpha(scene.materials[f], uv[0], uv[1], pixel * per_metre)
            n = _mix3(scene.normals, scene.faces, f, a, b, c)
            n = _unit(n[0], n[1], n[2])
            if n[2] < 0.0:
                n = (-n[0], -n[1], -n[2])
            p = _mix3(scene.vertices, scene.faces, f, a, b, c)
            t = 0.55 + 0.5 * strands(uv[0], uv[1], 60.0, pixel * per_metre)
            hair = colors.hair
            spot = Spot(hair[0] * t, hair[1] * t, hair[2] * t, 0.0, 0.0, 0.3, 0.0)
            r, g, bl = _lit(spot, lights, n, n, p, 0.9)
            for channel in range(4):
                out[y, x, channel] *= 1.0 - alpha
            out[y, x, 0] += alpha * display(r)
            out[y, x, 1] += alpha * display(g)
            out[y, x, 2] += alpha * display(bl)
            out[y, x, 3] += alpha
