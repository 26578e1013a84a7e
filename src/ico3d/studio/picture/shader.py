"""Deferred shading: colours samples whose triangle the rasteriser has found."""

import math
from typing import NamedTuple

import numpy as np

from ico3d.splat.cpu.compile import kernel, subroutine
from ico3d.studio.person.subject import Material
from ico3d.studio.picture import materials as paints
from ico3d.studio.picture.clothes import garments, knitwear
from ico3d.studio.picture.clothes.clothed import clothed
from ico3d.studio.picture.eyeball import shaded_eye
from ico3d.studio.picture.lighting import LOOKED_UP, lit, seen_lamp
from ico3d.studio.picture.skin import handed, lit_skin, relieved, skin_at
from ico3d.studio.picture.textures import noise, strands
from ico3d.studio.raster import weights_at

SKIN, MOUTH, EYE = int(Material.SKIN), int(Material.MOUTH), int(Material.EYE)
TEETH, GUMS, TONGUE = int(Material.TEETH), int(Material.GUMS), int(Material.TONGUE)
HAIR, CLOTH = int(Material.HAIR), int(Material.CLOTH)
TROUSERS, SHOE, SOCK = int(Material.TROUSERS), int(Material.SHOE), int(Material.SOCK)
SKIRT, FRAME = int(Material.SKIRT), int(Material.FRAME)


MOUTH_DEPTH = 0.042
"""Distance in metres behind the lips over which light in the mouth falls to 1/e."""
TOGETHER = 0.01
"""Relative difference of nearness up to which samples of a pixel show one surface."""
BRIGHTEST = 4.0
"""Linear light of the brightest sample: a pixel's edge stays smooth where a highlight ends."""


class Scene(NamedTuple):
    """One posed person as arrays for the shader.

    Attributes:
        faces: (F, 3) int32.
        materials: (F,) uint8.
        corner_uv: (F, 3, 2) float32.
        rest: (V, 3) float32 neutral vertices, at which textures are evaluated, metres.
        vertices: (V, 3) float32 posed vertices, canonical head space, metres.
        normals: (V, 3) float32.
        channels: (V, 7) float32 `Paint.channels`.
        strands: (V, 4) float32 `Paint.strands`.
        occlusion: (V,) float32 `Paint.occlusion_at` of this frame.
        lamps: (V, 2) float32 shares of key and rim light that clothes see; below 0 if they are
            looked up in the depth maps.
        fields: (V, 8) float32 `Tailored.fields`.
        folds: (V,) float32 `Tailored.folds` of this frame.
        eyes: (2, 25) float32 `eye_rows` of this frame.
        lines: (2, K, 8) float32 `Hands.lines`.
        nails: (2, 5, 7) float32 `Hands.nails`.
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
    lamps: np.ndarray
    fields: np.ndarray
    folds: np.ndarray
    eyes: np.ndarray
    lines: np.ndarray
    nails: np.ndarray


@subroutine(fast=False)
def _mix3(values, faces, f, a, b, c):
    """Interpolates a (V, 3) attribute."""
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    return (
        a * values[i, 0] + b * values[j, 0] + c * values[k, 0],
        a * values[i, 1] + b * values[j, 1] + c * values[k, 1],
        a * values[i, 2] + b * values[j, 2] + c * values[k, 2],
    )


@subroutine(fast=False)
def _unit(x, y, z):
    length = 1.0 / max(1e-12, math.sqrt(x * x + y * y + z * z))
    return x * length, y * length, z * length


@subroutine(fast=False)
def _uv(corner_uv, f, a, b, c):
    uv = corner_uv[f]
    return (
        a * uv[0, 0] + b * uv[1, 0] + c * uv[2, 0],
        a * uv[0, 1] + b * uv[1, 1] + c * uv[2, 1],
    )


@subroutine(fast=False)
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


@subroutine(fast=False)
def _painted(scene, f, a, b, c):
    """The channels of `Paint` at a spot."""
    i, j, k = scene.faces[f, 0], scene.faces[f, 1], scene.faces[f, 2]
    ch = scene.channels
    return (
        a * ch[i, 0] + b * ch[j, 0] + c * ch[k, 0],
        a * ch[i, 1] + b * ch[j, 1] + c * ch[k, 1],
        a * ch[i, 2] + b * ch[j, 2] + c * ch[k, 2],
        a * ch[i, 3] + b * ch[j, 3] + c * ch[k, 3],
        a * ch[i, 4] + b * ch[j, 4] + c * ch[k, 4],
        a * ch[i, 5] + b * ch[j, 5] + c * ch[k, 5],
        a * ch[i, 6] + b * ch[j, 6] + c * ch[k, 6],
    )


@subroutine(fast=False)
def _strand_shine(lights, tangent, v, p, n, shift, occlusion):
    """Two highlights of light on strands (Kajiya-Kay), white one and tinted one."""
    white, tinted = 0.0, 0.0
    for i in range(3):
        reach = seen_lamp(lights, i, p, n, occlusion)
        lx, ly, lz = lights.directions[i]
        hx, hy, hz = _unit(lx + v[0], ly + v[1], lz + v[2])
        along = tangent[0] * hx + tangent[1] * hy + tangent[2] * hz
        first, second = along + 0.09 + shift, along - 0.14 + shift
        strength = reach * lights.colors[i, 1]
        white += strength * max(0.0, 1.0 - first * first) ** 60.0
        tinted += strength * max(0.0, 1.0 - second * second) ** 16.0
    return white, tinted


@subroutine(fast=False)
def _spot(scene, colors, f, a, b, c, rest, pixel):
    """What the surface is made of at one spot."""
    material = scene.materials[f]
    x, y, z = rest
    if material == TROUSERS:
        return garments.trousers(colors, x, y, z, pixel)
    if material == SHOE:
        if colors.plain:
            return knitwear.leather(colors, x, y, z, pixel)
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
    if material == FRAME:
        return paints.frame()
    if material == TEETH:
        return paints.teeth(x, y, z, pixel)
    if material == GUMS:
        return paints.flesh(0.42, 0.15, 0.14, x, y, z, pixel)
    if material == TONGUE:
        return paints.tongue(x, y, z, pixel)
    return paints.flesh(0.34, 0.11, 0.10, x, y, z, pixel)


@subroutine(fast=False)
def _shade_one(scene, colors, lights, f, a, b, c, camera, pixel):
    """Linear light (3) from one spot of a solid face."""
    rest = _mix3(scene.rest, scene.faces, f, a, b, c)
    p = _mix3(scene.vertices, scene.faces, f, a, b, c)
    n = _mix3(scene.normals, scene.faces, f, a, b, c)
    n = _unit(n[0], n[1], n[2])
    v = _unit(camera[0] - p[0], camera[1] - p[1], camera[2] - p[2])
    if n[0] * v[0] + n[1] * v[1] + n[2] * v[2] < -0.2:
        n = (-n[0], -n[1], -n[2])
    smooth = n
    i, j, k = scene.faces[f, 0], scene.faces[f, 1], scene.faces[f, 2]
    occlusion = a * scene.occlusion[i] + b * scene.occlusion[j] + c * scene.occlusion[k]
    known = (
        a * scene.lamps[i, 0] + b * scene.lamps[j, 0] + c * scene.lamps[k, 0],
        a * scene.lamps[i, 1] + b * scene.lamps[j, 1] + c * scene.lamps[k, 1],
    )
    material = scene.materials[f]
    if material == EYE:
        eye = scene.eyes[0 if rest[0] > 0.0 else 1]
        return shaded_eye(colors, eye, p, v, smooth, lights, occlusion, pixel)
    if material == SKIN:
        values = _painted(scene, f, a, b, c)
        wide = pixel / max(0.3, n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
        n, hollow = relieved(n, values[0], rest[0], rest[1], rest[2], wide)
        skin = skin_at(colors, values, rest[0], rest[1], rest[2], wide)
        if values[6] > 0.1:
            side = 0 if rest[0] > 0.0 else 1
            skin, open_ = handed(skin, scene.lines[side], scene.nails[side], rest, wide)
            hollow *= open_
        return lit_skin(skin, lights, n, v, p, smooth, occlusion * hollow)
    if material == HAIR:
        tx, ty, tz, per_metre = _strand(scene, f, a, b, c)
        uv = _uv(scene.corner_uv, f, a, b, c)
        spot = paints.hair(colors, uv[0], uv[1], rest[0], rest[1], rest[2], pixel * per_metre)
        shift = 0.10 * strands(uv[0], uv[1], 260.0, pixel * per_metre)
        white, tinted = _strand_shine(lights, (tx, ty, tz), v, p, n, shift, occlusion)
        r, g, bl = lit(spot, lights, n, v, p, n, occlusion, LOOKED_UP)
        return (
            r + 0.022 * white + 0.9 * tinted * colors.hair[0],
            g + 0.020 * white + 0.9 * tinted * colors.hair[1],
            bl + 0.018 * white + 0.9 * tinted * colors.hair[2],
        )
    if colors.plain and material in (CLOTH, TROUSERS):
        # A pixel sees more of a surface that turns away: fine relief fades there.
        wide = pixel / max(0.3, n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
        spot, n, valley = clothed(scene, colors, f, a, b, c, rest, n, wide)
        return lit(spot, lights, n, v, p, smooth, occlusion * valley, known)
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
    if material in (CLOTH, TROUSERS, SHOE, SOCK, SKIRT, FRAME):
        return lit(spot, lights, n, v, p, smooth, occlusion, known)
    inward = math.exp(-_painted(scene, f, a, b, c)[5] / MOUTH_DEPTH)
    r, g, bl = lit(spot, lights, n, v, p, smooth, (0.35 + 0.65 * occlusion) * inward, LOOKED_UP)
    # Deep in the mouth, light has been red-tinted by lips and cheeks.
    if material == TEETH:
        return r * inward, g * inward**1.12, bl * inward**1.25
    return r * (0.25 + 0.75 * inward), g * inward**1.4, bl * inward**1.6


@kernel(fast=False)
def shade(scene, colors, lights, screen, nearest, triangle, camera, pixel, out):
    """Colours pixels by the light of the faces that their samples see.

    Samples of a pixel that see one material at one depth are coloured once, in their midst; small
    bright things such as eyes sample by sample.

    Args:
        scene: The posed person.
        colors: Colours of the person.
        lights: Lights of the frame.
        screen: (V, 3) float32 from `to_screen`.
        nearest: (H·S, W·S) float32 from `rasterise`, with S × S samples per pixel.
        triangle: (H·S, W·S) int32 from `rasterise`.
        camera: (3,) the camera's centre in canonical head space.
        pixel: Size of a pixel at the head, metres.
        out: (H, W, 4) float32 linear light and alpha, premultiplied; changed where covered.
    """
    height, width = out.shape[:2]
    across = triangle.shape[0] // height
    count = across * across
    left = np.zeros(count, np.bool_)
    for y in range(height):
        for x in range(width):
            remaining = 0
            for s in range(count):
                left[s] = triangle[y * across + s // across, x * across + s % across] >= 0
                remaining += left[s]
            share = 1.0 / count
            while remaining > 0:
                s, members = _midst(scene.materials, nearest, triangle, x, y, across, left)
                remaining -= members
                column, row = x * across + s % across, y * across + s // across
                f = triangle[row, column]
                a, b, c = weights_at(screen, scene.faces, f, column + 0.5, row + 0.5)
                r, g, bl = _shade_one(scene, colors, lights, f, a, b, c, camera, pixel)
                part = members * share
                out[y, x, 0] += part * min(r, BRIGHTEST)
                out[y, x, 1] += part * min(g, BRIGHTEST)
                out[y, x, 2] += part * min(bl, BRIGHTEST)
                out[y, x, 3] += part


@subroutine(fast=False)
def _midst(materials, nearest, triangle, x, y, across, left):
    """The middle one of the samples of a pixel that belong together, and how many these are.

    Args:
        materials: (F,) uint8.
        nearest: (H·S, W·S) float32 nearness of the samples.
        triangle: (H·S, W·S) int32 faces of the samples.
        x: Column of the pixel.
        y: Row of the pixel.
        across: S.
        left: (S²,) bool samples of the pixel that are to be coloured; those found are taken away.
    """
    first, members, middle_x, middle_y = -1, 0, 0.0, 0.0
    material, near = 0, np.float32(0.0)
    for s in range(left.shape[0]):
        if not left[s]:
            continue
        row, column = y * across + s // across, x * across + s % across
        f = triangle[row, column]
        if first < 0:
            first, material, near = s, materials[f], nearest[row, column]
        elif materials[f] != material or abs(nearest[row, column] / near - 1.0) > TOGETHER:
            continue
        members += 1
        middle_x += s % across
        middle_y += s // across
        if material in (EYE, TEETH):
            left[s] = False
            return s, 1
    middle_x, middle_y = middle_x / members, middle_y / members
    best, closest = first, 1e9
    for s in range(left.shape[0]):
        if not left[s]:
            continue
        row, column = y * across + s // across, x * across + s % across
        f = triangle[row, column]
        if materials[f] != material or abs(nearest[row, column] / near - 1.0) > TOGETHER:
            continue
        left[s] = False
        away = (s % across - middle_x) ** 2 + (s // across - middle_y) ** 2
        if away < closest:
            best, closest = s, away
    return best, members
