"""Eyes: a ball of white with a bulging cornea, and an iris that is seen through it.

The mesh says only where an eye is seen: its surface is computed, so that iris and pupil are round,
lie behind the cornea and shift with the view as real ones do.
"""

import math

import numpy as np

from ico3d.splat.cpu.compile import subroutine
from ico3d.studio.person.subject import Material, Subject
from ico3d.studio.picture.lighting import KEY, LOOKED_UP, lit, mirrored, seen_lamp
from ico3d.studio.picture.materials import Spot
from ico3d.studio.picture.textures import grain, noise, smoothstep

LIMB = 1.05
"""Radius of the cornea relative to the iris."""
CURVATURE = 1.34
"""Radius of curvature of the cornea relative to the iris: 7.8 mm at 5.8 mm."""
IRIS_DEPTH = 0.10
"""Depth of the iris behind the rim of the cornea, relative to its radius."""
INDEX = 1.336
"""Refractive index of what lies between cornea and iris."""
PUPIL = 0.34
"""Radius of the pupil relative to the iris."""
FAR = 1e9
"""Distance in metres to what a ray misses."""
LIDS = (((42, 43, 44, 45), (42, 47, 46, 45)), ((39, 38, 37, 36), (39, 40, 41, 36)))
"""Landmarks of upper and lower lid of the left and of the right eye, from the nose outwards."""


def eye_rows(subject: Subject, vertices: np.ndarray) -> np.ndarray:
    """What the shader needs to know of both eyes in one frame.

    Args:
        subject: The person.
        vertices: (V, 3) posed vertices, canonical head space, metres.

    Returns:
        (2, 25) float32 for the left and the right eye: centre (3), axes as rows (9: two across the
        gaze, and the gaze), radius of the ball and of the iris, parabolas y(x) of the upper and of
        the lower lid along those axes (3 each, constant first), inner corner (2), zeros. Metres.
    """
    ball = np.unique(subject.faces[subject.materials == Material.EYE])
    left = subject.vertices[ball, 0] > 0
    marks = subject.landmarks(vertices).astype(float)
    rows = np.zeros((2, 25), np.float32)
    for row, eye, side, lids in zip(rows, subject.eyes, (left, ~left), LIDS, strict=True):
        rest, posed = subject.vertices[ball[side]].astype(float), vertices[ball[side]].astype(float)
        turn = _rotation(rest, posed) if len(rest) > 3 else np.eye(3)
        centre = posed.mean(axis=0) + turn @ (eye.centre - rest.mean(axis=0))
        ahead = turn @ eye.axis
        across = np.cross([0.0, 1.0, 0.0], ahead)
        across /= np.linalg.norm(across)
        axes = np.stack([across, np.cross(ahead, across), ahead])
        local = (rest - eye.centre) @ eye.axis
        distance = np.linalg.norm(rest - eye.centre, axis=1)
        white = distance[(local > 0.3 * distance) & (local < 0.85 * distance)]
        row[:3], row[3:12] = centre, axes.ravel()
        row[12] = np.median(white) if len(white) else max(2.3 * eye.iris_radius, 0.012)
        row[13] = eye.iris_radius
        for first, lid in zip((14, 17), lids, strict=True):
            at = (marks[list(lid)] - centre) @ axes.T  # (4, 3)
            if np.ptp(at[:, 0]) > 0.005:
                row[first : first + 3] = np.polyfit(at[:, 0], at[:, 1], 2)[::-1]
            else:
                row[first] = 0.02 if first == 14 else -0.02
        row[20:22] = ((marks[lids[0][0]] - centre) @ axes.T)[:2]
    return rows


def _rotation(rest: np.ndarray, posed: np.ndarray) -> np.ndarray:
    """(3, 3) rotation that turns points (N, 3) at rest best into posed ones (Kabsch)."""
    u, _, vt = np.linalg.svd((posed - posed.mean(axis=0)).T @ (rest - rest.mean(axis=0)))
    return u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt


@subroutine()
def _inner(e, first, x, y, z):
    return e[first] * x + e[first + 1] * y + e[first + 2] * z


@subroutine()
def _outer(e, x, y, z):
    """From an eye's axes back to canonical space."""
    return (
        e[3] * x + e[6] * y + e[9] * z,
        e[4] * x + e[7] * y + e[10] * z,
        e[5] * x + e[8] * y + e[11] * z,
    )


@subroutine()
def _hit(px, py, pz, dx, dy, dz, middle, radius):
    """Distance along a unit ray to the front of a sphere about (0, 0, middle), `FAR` beside it."""
    oz = pz - middle
    b = px * dx + py * dy + oz * dz
    c = px * px + py * py + oz * oz - radius * radius
    square = b * b - c
    if square < 0.0:
        return FAR
    return -b - math.sqrt(square)


@subroutine()
def shaded_eye(colors, e, p, v, smooth, lights, occlusion, pixel):
    """Linear light (3) that one spot of an eye sends to the camera.

    Args:
        colors: Colours of the person.
        e: (25,) row of `eye_rows`.
        p: Position (3) on the mesh, canonical space, metres.
        v: Unit vector (3) towards the camera.
        smooth: Unit normal (3) of the mesh.
        lights: Lights of the frame.
        occlusion: Visible share of the sky.
        pixel: Size of a pixel, metres.
    """
    ball, iris = e[12], e[13]
    ox, oy, oz = p[0] - e[0], p[1] - e[1], p[2] - e[2]
    px, py, pz = _inner(e, 3, ox, oy, oz), _inner(e, 6, ox, oy, oz), _inner(e, 9, ox, oy, oz)
    dx, dy, dz = (
        -_inner(e, 3, v[0], v[1], v[2]),
        -_inner(e, 6, v[0], v[1], v[2]),
        -_inner(e, 9, v[0], v[1], v[2]),
    )
    limb = LIMB * iris
    rim = math.sqrt(max(1e-9, ball * ball - limb * limb))
    middle = rim - iris * math.sqrt(CURVATURE * CURVATURE - LIMB * LIMB)
    t = _hit(px, py, pz, dx, dy, dz, middle, CURVATURE * iris)
    on_cornea = t < FAR and pz + t * dz > rim
    if not on_cornea:
        t = _hit(px, py, pz, dx, dy, dz, 0.0, ball)
    if t >= FAR:
        t = 0.0
    wx, wy, wz = px + t * dx, py + t * dy, pz + t * dz
    across = math.sqrt(wx * wx + wy * wy)
    white = _white(e, wx, wy, wz, across, pixel)
    length = 1.0 / math.sqrt(wx * wx + wy * wy + wz * wz)
    nx, ny, nz = wx * length, wy * length, wz * length
    cornea = 1.0 - smoothstep(0.93 * limb, 1.07 * limb, across)
    cx, cy, cz = wx, wy, wz - middle
    length = 1.0 / math.sqrt(cx * cx + cy * cy + cz * cz)
    gx, gy, gz = (
        nx + cornea * (cx * length - nx),
        ny + cornea * (cy * length - ny),
        nz + cornea * (cz * length - nz),
    )
    length = 1.0 / math.sqrt(gx * gx + gy * gy + gz * gz)
    gx, gy, gz = gx * length, gy * length, gz * length
    # How far inside the opening of the lids: their shadow, and the wet line along the lower one.
    above = e[14] + wx * (e[15] + wx * e[16]) - wy
    below = wy - (e[17] + wx * (e[18] + wx * e[19]))
    shadow = 1.0 - 0.72 * math.exp(-max(0.0, above) / 0.0021)
    shadow *= 1.0 - 0.35 * math.exp(-max(0.0, below) / 0.0012)
    world = _outer(e, nx, ny, nz)
    spot = Spot(white[0], white[1], white[2], 1.0, 0.0, 0.32, 0.0, 0.0)
    r, g, b = lit(spot, lights, world, v, p, smooth, occlusion * shadow, LOOKED_UP)
    if on_cornea:
        ir, ig, ib, share = _behind(
            colors, e, (wx, wy, wz), (gx, gy, gz), (dx, dy, dz), rim, lights, pixel
        )
        reach = (0.25 + 0.75 * seen_lamp(lights, KEY, p, smooth, occlusion)) * shadow
        r, g, b = (
            r + share * (reach * ir - r),
            g + share * (reach * ig - g),
            b + share * (reach * ib - b),
        )
    facing = max(0.0, -(gx * dx + gy * dy + gz * dz))
    mirror = 0.022 + 0.978 * (1.0 - facing) ** 5
    turned = _outer(e, dx + 2 * facing * gx, dy + 2 * facing * gy, dz + 2 * facing * gz)
    sharp = 0.02 + 0.10 * (1.0 - cornea)
    mr, mg, mb = mirrored(lights, turned, sharp)
    open_ = shadow * (0.35 + 0.65 * occlusion)
    wet = 0.14 * math.exp(-(((below - 0.0003) / 0.00035) ** 2))
    gloss = math.sqrt(open_) * min(0.35, mirror) + wet * (0.4 + 0.6 * occlusion)
    return r + gloss * mr, g + gloss * mg, b + gloss * mb


@subroutine()
def _white(e, x, y, z, across, pixel):
    """Albedo (3) of the white: yellowish and veined at the sides, pink in the inner corner."""
    far = smoothstep(1.1 * e[13], 2.0 * e[13], across)
    fibre = abs(grain(1.0 * x, 2.2 * y, z, 0.0021, pixel)) + 0.3 * (
        1.0 - smoothstep(0.0, 0.01, pixel)
    )
    vein = (1.0 - smoothstep(0.0, 0.16, fibre - 0.3)) * far
    near = math.sqrt((x - e[20]) ** 2 + (y - e[21]) ** 2)
    pink = math.exp(-((near / 0.0034) ** 2))
    r = 0.62 - 0.05 * far
    g = 0.57 - 0.10 * far - 0.10 * vein
    b = 0.53 - 0.11 * far - 0.10 * vein
    return (
        r + pink * (0.62 - r),
        g + pink * (0.30 - g),
        b + pink * (0.26 - b),
    )


@subroutine()
def _behind(colors, e, place, normal, ray, rim, lights, pixel):
    """What is seen through the cornea: light (3), and its share against the white (1)."""
    iris = e[13]
    wx, wy, wz = place
    gx, gy, gz = normal
    dx, dy, dz = ray
    ratio = 1.0 / INDEX
    cosine = -(gx * dx + gy * dy + gz * dz)
    bend = ratio * cosine - math.sqrt(max(0.0, 1.0 - ratio * ratio * (1.0 - cosine * cosine)))
    rx, ry, rz = ratio * dx + bend * gx, ratio * dy + bend * gy, ratio * dz + bend * gz
    reach = (wz - (rim - IRIS_DEPTH * iris)) / max(0.05, -rz)
    x, y = (wx + reach * rx) / iris, (wy + reach * ry) / iris
    t = math.sqrt(x * x + y * y)
    soft = max(0.03, 0.6 * pixel / iris)
    angle = math.atan2(y, x)
    ca, sa = math.cos(angle), math.sin(angle)
    fine = noise(17.0 * ca + 9.0, 17.0 * sa + 3.0, 1.6 * t)
    thick = noise(6.5 * ca + 1.0, 6.5 * sa + 5.0, 2.6 * t + 7.0)
    detail = min(1.0, max(0.2, 0.0010 / pixel))
    fibre = 1.0 + detail * (0.9 * (fine - 0.5) + 0.7 * (thick - 0.5))
    ruff = math.exp(-(((t - 0.50 - 0.05 * (thick - 0.5)) / 0.09) ** 2))
    glow = 0.68 * fibre * (0.75 + 0.35 * ruff + 0.45 * smoothstep(0.45, 0.8, t))
    ring = smoothstep(0.70, 0.96, t)
    warm = 1.0 - smoothstep(0.40, 0.66, t)
    dark = (1.0 - 0.88 * ring) * smoothstep(PUPIL - soft, PUPIL + soft, t)
    r = colors.iris[0] * glow * dark * (1.0 + 0.8 * warm)
    g = colors.iris[1] * glow * dark * (1.0 + 0.15 * warm)
    b = colors.iris[2] * glow * dark * (1.0 - 0.35 * warm)
    # The cornea is a lens: light from one side gathers on the other side of the iris.
    lr, lg, lb = 0.42, 0.42, 0.43
    for i in range(2):
        to = lights.directions[i]
        lx, ly = _inner(e, 3, to[0], to[1], to[2]), _inner(e, 6, to[0], to[1], to[2])
        lz = _inner(e, 9, to[0], to[1], to[2])
        if lz <= 0.0:
            continue
        aside = -(lx * x + ly * y)
        gathered = lz * (0.45 + 1.5 * max(0.0, aside + 0.12) ** 1.5)
        lr += lights.colors[i, 0] * gathered
        lg += lights.colors[i, 1] * gathered
        lb += lights.colors[i, 2] * gathered
    share = 1.0 - smoothstep(0.97 - soft, 1.05 + soft, t)
    return r * lr + 0.002, g * lg + 0.002, b * lb + 0.002, share
