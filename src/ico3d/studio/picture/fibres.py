"""Draws strands of hair: lit as fibres, blended from far to near over the finished surfaces."""

import math

import numpy as np

from ico3d.common.camera import Camera
from ico3d.splat.cpu.compile import kernel, subroutine
from ico3d.studio.person.strands import Strands
from ico3d.studio.person.subject import Material
from ico3d.studio.picture.lighting import Lights, ambient, seen_lamp
from ico3d.studio.raster import to_screen

MIDDLE = np.array([0.0, 0.02, 0.0], np.float32)
"""Point in canonical head space, metres, from which hair faces outwards."""

SHARE = {Material.BROW: 1.35, Material.LASH: 0.30}
"""Albedo of brows and lashes relative to that of the hair."""
WELL_BEHIND = 0.02
"""Metres behind a surface at which segments of strands are left out, if both ends lie there."""
SAMPLE_BIAS = 0.0012
"""Metres behind a surface at which a strand is still drawn: roots begin in the skin."""


@kernel()
def shown(screen, first, nearest, factor):
    """Whether a segment that is to be drawn begins at each point, (M,) bool.

    It lies in front of the camera, and not well behind a surface: half of all hair does.

    Args:
        screen: (M, 3) float32 from `to_screen` with one sample per pixel.
        first: (N + 1,) int32 `Strands.first`.
        nearest: (H·factor, W·factor) float32 nearness of the surfaces.
        factor: Samples of `nearest` along the side of a pixel.
    """
    out = np.zeros(screen.shape[0], np.bool_)
    for s in range(first.shape[0] - 1):
        for a in range(first[s], first[s + 1] - 1):
            b = a + 1
            if screen[a, 2] <= 0.0 or screen[b, 2] <= 0.0:
                continue
            out[a] = not (
                _covered(nearest, screen[a, 0], screen[a, 1], factor, screen[a, 2])
                and _covered(nearest, screen[b, 0], screen[b, 1], factor, screen[b, 2])
            )
    return out


@kernel()
def lit_strands(points, first, begins, open_, tone, colors, centre, camera, lights):
    """Light that points of strands send to a camera (Kajiya-Kay with two shifted highlights).

    The first highlight has the colour of the lamp and is shifted towards the root by the scales of
    the hair; the second went through the fibre, has its colour, and is shifted towards the tip
    (Marschner et al., "Light scattering from human hair fibers").

    Args:
        points: (M, 3) float32 canonical head space, metres.
        first: (N + 1,) int32 `Strands.first`.
        begins: (M,) bool from `shown`.
        open_: (M,) float32 `Strands.open`.
        tone: (N,) float32 `Strands.tone`.
        colors: (N, 3) float32 albedo of each strand.
        centre: (3,) middle of the head, from which hair faces outwards.
        camera: (3,) centre of the camera.
        lights: Lights of the frame.

    Returns:
        (M, 3) float32 linear light; 0 at points of no segment that is shown.
    """
    out = np.zeros(points.shape, np.float32)
    seen = np.zeros(3)
    for s in range(first.shape[0] - 1):
        begin, end = first[s], first[s + 1]
        shift = 0.03 * math.sin(12.9898 * s)
        red, green, blue = colors[s, 0] * tone[s], colors[s, 1] * tone[s], colors[s, 2] * tone[s]
        for m in range(begin, end):
            # Shadows are soft: every second point looks them up, in turn between neighbours.
            fresh = m == begin or (m + s) % 2 == 0
            lends = fresh and m + 1 < end and begins[m + 1]
            if not (begins[m] or (m > begin and begins[m - 1]) or lends):
                continue
            before, after = max(begin, m - 1), min(end - 1, m + 1)
            tx = points[after, 0] - points[before, 0]
            ty = points[after, 1] - points[before, 1]
            tz = points[after, 2] - points[before, 2]
            tx, ty, tz = _unit(tx, ty, tz)
            px, py, pz = points[m, 0], points[m, 1], points[m, 2]
            vx, vy, vz = _unit(camera[0] - px, camera[1] - py, camera[2] - pz)
            nx, ny, nz = px - centre[0], py - centre[1], pz - centre[2]
            along = nx * tx + ny * ty + nz * tz
            nx, ny, nz = _unit(nx - along * tx, ny - along * ty, nz - along * tz)
            free = open_[m]
            ar, ag, ab = ambient(lights, (nx, ny, nz))
            r, g, b = 0.75 * free * ar * red, 0.75 * free * ag * green, 0.75 * free * ab * blue
            sin_v = tx * vx + ty * vy + tz * vz
            for i in range(3):
                to = lights.directions[i]
                if fresh:
                    seen[i] = seen_lamp(lights, i, (px, py, pz), (nx, ny, nz), 0.8)
                reach = free * seen[i]
                if reach <= 0.0:
                    continue
                sin_l = tx * to[0] + ty * to[1] + tz * to[2]
                cosine = math.sqrt(max(0.0, 1.0 - sin_l * sin_l))
                facing = nx * to[0] + ny * to[1] + nz * to[2]
                soft = cosine * min(1.0, max(0.0, 0.45 + 0.55 * facing))
                total = sin_l + sin_v
                wide = 0.10 + 0.3 * lights.sizes[i]
                one = (total - 0.12 - shift) / (0.13 + 0.4 * wide)
                two = (total + 0.20 - shift) / (0.22 + 0.6 * wide)
                front = min(1.0, max(0.0, 0.3 + facing))
                white = 0.032 * front * math.exp(-one * one)
                through = 0.7 * front * math.exp(-two * two)
                back = -(vx * to[0] + vy * to[1] + vz * to[2])
                glow = 1.6 * max(0.0, back - 0.35) ** 2 * cosine
                body = 0.55 * soft + through + glow
                r += reach * lights.colors[i, 0] * (red * body + white)
                g += reach * lights.colors[i, 1] * (green * body + white)
                b += reach * lights.colors[i, 2] * (blue * body + white)
            out[m, 0], out[m, 1], out[m, 2] = r, g, b
    return out


@subroutine()
def _unit(x, y, z):
    length = 1.0 / max(1e-12, math.sqrt(x * x + y * y + z * z))
    return x * length, y * length, z * length


def far_to_near(nearness: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """First points of the segments that are shown, the farthest first.

    Args:
        nearness: (M,) 1/z of the points.
        begins: (M,) bool from `shown`.
    """
    start = np.flatnonzero(begins)
    return start[np.argsort(nearness[start], kind="stable")].astype(np.int32)


@kernel()
def draw_strands(order, screen, width, light, nearest, factor, picture):
    """Blends segments of strands over a picture, smoothly also where they are thinner than pixels.

    Args:
        order: (S,) int32 first points of the segments, from far to near.
        screen: (M, 3) float32 from `to_screen` with one sample per pixel.
        width: (M,) float32 half of the thickness in pixels.
        light: (M, 3) float32 linear light of the points.
        nearest: (H·factor, W·factor) float32 nearness of the surfaces.
        factor: Samples of `nearest` along the side of a pixel.
        picture: (H, W, 4) float32 linear light and alpha, premultiplied; changed in place.
    """
    height, wide = picture.shape[0], picture.shape[1]
    for index in range(order.shape[0]):
        a = order[index]
        b = a + 1
        ax, ay, bx, by = screen[a, 0], screen[a, 1], screen[b, 0], screen[b, 1]
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        if square < 1e-8:
            continue
        length = math.sqrt(square)
        half = 0.5 * (width[a] + width[b])
        reach = half + 0.5
        steep = abs(dy) > abs(dx)
        # Walk along the longer axis; across it, only the pixels that the strand can touch.
        if steep:
            begin, end = min(ay, by), max(ay, by)
            slope, rows, columns = dx / dy, height, wide
            start = ax - ay * slope
            span = reach * length / abs(dy)
        else:
            begin, end = min(ax, bx), max(ax, bx)
            slope, rows, columns = dy / dx, wide, height
            start = ay - ax * slope
            span = reach * length / abs(dx)
        low = max(0, math.floor(begin - reach))
        high = min(rows - 1, math.ceil(end + reach))
        for major in range(low, high + 1):
            middle = start + (major + 0.5) * slope
            left = max(0, math.floor(middle - span))
            right = min(columns - 1, math.ceil(middle + span))
            for minor in range(left, right + 1):
                if steep:
                    x, y = minor, major
                else:
                    x, y = major, minor
                px, py = x + 0.5 - ax, y + 0.5 - ay
                t = (px * dx + py * dy) / square
                if t < 0.0 or t >= 1.0:
                    continue
                away = abs(px * dy - py * dx) / length
                thick = width[a] + t * (width[b] - width[a])
                # Overlap of the strand, as a stripe, with a pixel, as a box one pixel wide.
                cover = min(away + 0.5, thick) - max(away - 0.5, -thick)
                if cover <= 0.0:
                    continue
                nearness = screen[a, 2] + t * (screen[b, 2] - screen[a, 2])
                cover *= _seen(nearest, x, y, factor, nearness)
                if cover <= 0.0:
                    continue
                for c in range(3):
                    value = light[a, c] + t * (light[b, c] - light[a, c])
                    picture[y, x, c] += cover * (value - picture[y, x, c])
                picture[y, x, 3] += cover * (1.0 - picture[y, x, 3])


@subroutine()
def _covered(nearest, x, y, factor, nearness):
    """Whether a place in pixels lies well behind a surface, as all of a short segment does then."""
    column, row = int(x * factor), int(y * factor)
    if x < 0.0 or y < 0.0 or row >= nearest.shape[0] or column >= nearest.shape[1]:
        return False
    return nearest[row, column] * (1.0 - WELL_BEHIND * nearness) > nearness


@subroutine()
def _seen(nearest, x, y, factor, nearness):
    """Share of a pixel's samples in which no surface hides a place."""
    bound = nearness / (1.0 - SAMPLE_BIAS * nearness)
    middle = factor // 2
    seen = 0
    if nearest[y * factor + middle, x * factor + middle] <= bound:
        seen += 2
    last = factor - 1
    for dy in (0, last):
        for dx in (0, last):
            if nearest[y * factor + dy, x * factor + dx] <= bound:
                seen += 1
    return seen / 6.0


def strand_colors(strands: Strands, hair: np.ndarray) -> np.ndarray:
    """(N, 3) float32 albedo of strands: those of brows are paler than hair (3,), lashes darker.

    Brows have fewer hairs that shade each other, so that they look like the hair in the end.
    """
    share = np.ones(len(strands.material))
    for material, value in SHARE.items():
        share[strands.material == material] = value
    return (share[:, None] * hair).astype(np.float32)


def overlay(
    picture: np.ndarray,
    nearest: np.ndarray,
    factor: int,
    strands: Strands,
    points: np.ndarray,
    colors: np.ndarray,
    camera: Camera,
    lights: Lights,
) -> None:
    """Draws strands over a picture of the surfaces that they grow on.

    Args:
        picture: (H, W, 4) float32 linear light and alpha, premultiplied; changed in place.
        nearest: (H·factor, W·factor) float32 nearness of the surfaces.
        factor: Samples of `nearest` along the side of a pixel.
        strands: The strands.
        points: (M, 3) float32 their points in this frame, canonical head space, metres.
        colors: (N, 3) float32 albedo of each strand.
        camera: The camera in canonical head space.
        lights: Lights of the frame.
    """
    screen = to_screen(points, camera, 1)  # (M, 3)
    begins = shown(screen, strands.first, nearest, factor)
    order = far_to_near(screen[:, 2], begins)
    eye = camera.camera_to_world[:3, 3].astype(np.float32)
    light = lit_strands(
        points, strands.first, begins, strands.open, strands.tone, colors, MIDDLE, eye, lights
    )
    width = (strands.radius * screen[:, 2] * camera.intrinsics[0, 0]).astype(np.float32)
    draw_strands(order, screen, width, light, nearest, factor, picture)
