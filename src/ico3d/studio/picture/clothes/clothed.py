"""Plain clothes on the mesh: the material of a spot, and its normal with the cloth's relief."""

import math

from ico3d.splat.cpu.compile import kernel, subroutine
from ico3d.studio.person.subject import Material
from ico3d.studio.picture.clothes import knitwear
from ico3d.studio.picture.clothes.relief import Weave, denim_height, folds, knit_height, moved

TROUSERS = int(Material.TROUSERS)
FINEST = 0.0004
"""Smallest distance in metres over which relief is differentiated; else half a pixel."""
STEEPEST = 1.1
"""Largest slope of relief: beyond it, cloth would hide itself."""
VALLEY = 0.45
"""Share of ambient light that the deepest valley between folds loses."""


@subroutine()
def clothed(scene, colors, f, a, b, c, rest, n, pixel):
    """Knitwear or denim at a spot.

    Args:
        scene: The posed person.
        colors: Colours of the person.
        f: Number of the face.
        a: Weight of the face's first corner.
        b: Weight of its second corner.
        c: Weight of its third corner.
        rest: Place (3) on the person at rest, metres.
        n: Unit normal (3) of the mesh.
        pixel: Size of a pixel on the surface, metres.

    Returns:
        The `Spot`, the unit normal (3) with relief, and the share of ambient light that folds let
        through.
    """
    i, j, k = scene.faces[f, 0], scene.faces[f, 1], scene.faces[f, 2]
    w, first, second = _weave(scene, f, i, j, k, a, b, c)
    one, two = _edge(scene.vertices, i, j), _edge(scene.vertices, i, k)
    h = max(FINEST, 0.5 * pixel)
    long1 = h / max(1e-6, math.sqrt(one[0] * one[0] + one[1] * one[1] + one[2] * one[2]))
    long2 = h / max(1e-6, math.sqrt(two[0] * two[0] + two[1] * two[1] + two[2] * two[2]))
    near1, near2, fold = moved(w, first, long1), moved(w, second, long2), folds(w)
    rise1, rise2 = (folds(near1) - fold) / long1, (folds(near2) - fold) / long2
    if scene.materials[f] == TROUSERS:
        height = denim_height(w, pixel)
        rise1 += (denim_height(near1, pixel) - height) / long1
        rise2 += (denim_height(near2, pixel) - height) / long2
        spot = knitwear.jeans(colors, w, rest[0], rest[1], rest[2], pixel)
    else:
        height = knit_height(w, pixel)
        rise1 += (knit_height(near1, pixel) - height) / long1
        rise2 += (knit_height(near2, pixel) - height) / long2
        spot = knitwear.jumper(colors, w, height, rest[0], rest[1], rest[2], pixel)
    valley = 1.0
    if w.fold > 1e-5:
        open_ = min(1.0, fold / (1.2 * w.fold))
        valley = 1.0 - VALLEY * min(1.0, w.fold / 0.004) * (1.0 - open_)
    return spot, tilted(n, one, two, rise1, rise2), valley


@kernel()
def tilted(n, one, two, rise1, rise2):
    """The unit normal of a surface that rises by `rise1` along edge `one`, `rise2` along `two`."""
    r1 = (
        two[1] * n[2] - two[2] * n[1],
        two[2] * n[0] - two[0] * n[2],
        two[0] * n[1] - two[1] * n[0],
    )
    r2 = (
        n[1] * one[2] - n[2] * one[1],
        n[2] * one[0] - n[0] * one[2],
        n[0] * one[1] - n[1] * one[0],
    )
    area = one[0] * r1[0] + one[1] * r1[1] + one[2] * r1[2]
    size = max(1e-12, abs(area))
    sign = 1.0 if area > 0.0 else -1.0
    x, y, z = (
        rise1 * r1[0] + rise2 * r2[0],
        rise1 * r1[1] + rise2 * r2[1],
        rise1 * r1[2] + rise2 * r2[2],
    )
    slope = math.sqrt(x * x + y * y + z * z) / size
    sign *= STEEPEST / max(STEEPEST, slope)
    x, y, z = size * n[0] - sign * x, size * n[1] - sign * y, size * n[2] - sign * z
    length = 1.0 / max(1e-20, math.sqrt(x * x + y * y + z * z))
    return x * length, y * length, z * length


@subroutine()
def _edge(vertices, i, j):
    """(3) from one vertex to another."""
    return (
        vertices[j, 0] - vertices[i, 0],
        vertices[j, 1] - vertices[i, 1],
        vertices[j, 2] - vertices[i, 2],
    )


@subroutine()
def _weave(scene, f, i, j, k, a, b, c):
    """The place on the cloth, and how it changes along the face's first and last edge."""
    uv, t = scene.corner_uv[f], scene.fields
    x = Weave(
        uv[0, 0], uv[0, 1], t[i, 0], t[i, 1], t[i, 2], t[i, 3], t[i, 4], t[i, 5], t[i, 6], t[i, 7],
        scene.folds[i],
    )  # fmt: skip
    first = Weave(
        uv[1, 0] - uv[0, 0], uv[1, 1] - uv[0, 1], t[j, 0] - t[i, 0], t[j, 1] - t[i, 1],
        t[j, 2] - t[i, 2], t[j, 3] - t[i, 3], t[j, 4] - t[i, 4], t[j, 5] - t[i, 5], 0.0,
        t[j, 7] - t[i, 7], scene.folds[j] - scene.folds[i],
    )  # fmt: skip
    second = Weave(
        uv[2, 0] - uv[0, 0], uv[2, 1] - uv[0, 1], t[k, 0] - t[i, 0], t[k, 1] - t[i, 1],
        t[k, 2] - t[i, 2], t[k, 3] - t[i, 3], t[k, 4] - t[i, 4], t[k, 5] - t[i, 5], 0.0,
        t[k, 7] - t[i, 7], scene.folds[k] - scene.folds[i],
    )  # fmt: skip
    return moved(moved(x, first, b), second, c), first, second
