"""Procedural textures, evaluated at rest positions so that they stick to the surface.

Every texture knows the size of a pixel on the surface and fades out before aliasing, so that a spot
looks the same in every frame.
"""

import math

from ico3d.splat.cpu.compile import kernel, subroutine


@subroutine()
def hashed(i, j, k):
    """A pseudo-random number in [0, 1) from three integers."""
    h = (i * 374761393 + j * 668265263 + k * 1274126177) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 1103515245) & 0xFFFFFFFF
    h = ((h ^ (h >> 16)) * 2654435761) & 0xFFFFFFFF
    return ((h ^ (h >> 15)) & 0xFFFFFF) / 16777216.0


@subroutine()
def smoothstep(low, high, value):
    """0 below `low`, 1 above `high`, a smooth transition between."""
    t = min(1.0, max(0.0, (value - low) / (high - low)))
    return t * t * (3.0 - 2.0 * t)


@kernel()
def noise(x, y, z):
    """Value noise in [0, 1] with features of size 1."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = int(fx), int(fy), int(fz)
    u, v, w = x - fx, y - fy, z - fz
    u, v, w = u * u * (3 - 2 * u), v * v * (3 - 2 * v), w * w * (3 - 2 * w)
    near = (hashed(i, j, k) * (1 - u) + hashed(i + 1, j, k) * u) * (1 - v) + (
        hashed(i, j + 1, k) * (1 - u) + hashed(i + 1, j + 1, k) * u
    ) * v
    far = (hashed(i, j, k + 1) * (1 - u) + hashed(i + 1, j, k + 1) * u) * (1 - v) + (
        hashed(i, j + 1, k + 1) * (1 - u) + hashed(i + 1, j + 1, k + 1) * u
    ) * v
    return near * (1 - w) + far * w


@kernel()
def slope(x, y, z):
    """Value of `noise` and its slopes along x, y and z."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = int(fx), int(fy), int(fz)
    u, v, w = x - fx, y - fy, z - fz
    du, dv, dw = 6 * u * (1 - u), 6 * v * (1 - v), 6 * w * (1 - w)
    u, v, w = u * u * (3 - 2 * u), v * v * (3 - 2 * v), w * w * (3 - 2 * w)
    a, b = hashed(i, j, k), hashed(i + 1, j, k)
    c, d = hashed(i, j + 1, k), hashed(i + 1, j + 1, k)
    e, f = hashed(i, j, k + 1), hashed(i + 1, j, k + 1)
    g, h = hashed(i, j + 1, k + 1), hashed(i + 1, j + 1, k + 1)
    near_low, near_high = a + u * (b - a), c + u * (d - c)
    far_low, far_high = e + u * (f - e), g + u * (h - g)
    near, far = near_low + v * (near_high - near_low), far_low + v * (far_high - far_low)
    along_u = (1 - w) * ((b - a) * (1 - v) + (d - c) * v) + w * ((f - e) * (1 - v) + (h - g) * v)
    along_v = (1 - w) * (near_high - near_low) + w * (far_high - far_low)
    return near + w * (far - near), du * along_u, dv * along_v, dw * (far - near)


@subroutine()
def visible(feature, pixel):
    """Visibility, 0 to 1, of a texture with features of this size at this pixel size."""
    return min(1.0, max(0.0, feature / pixel - 1.0))


@subroutine()
def grain(x, y, z, feature, pixel):
    """Noise in [-1, 1] with features of `feature` metres; fades out where pixels are larger."""
    fade = visible(feature, pixel)
    if fade == 0.0:
        return 0.0
    return (2.0 * noise(x / feature, y / feature, z / feature) - 1.0) * fade


@subroutine()
def spots(x, y, z, feature, pixel):
    """Round spots in [0, 1], at most one per cell of `feature` metres, of varied size."""
    fade = visible(0.5 * feature, pixel)
    if fade == 0.0:
        return 0.0
    gx, gy, gz = x / feature, y / feature, z / feature
    i, j, k = math.floor(gx), math.floor(gy), math.floor(gz)
    dx = gx - i - 0.3 - 0.4 * hashed(i, j, k + 101)
    dy = gy - j - 0.3 - 0.4 * hashed(i, j, k + 202)
    dz = gz - k - 0.3 - 0.4 * hashed(i, j, k + 303)
    radius = 0.08 + 0.22 * hashed(i, j, k)
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    return fade * (1.0 - smoothstep(0.5 * radius, radius, distance)) * hashed(i, j, k + 404)


@subroutine()
def strands(across, along, count, pixel_across):
    """Streaks in [-1, 1] that run along one texture axis.

    Args:
        across: Texture coordinate perpendicular to the strands.
        along: Texture coordinate along the strands.
        count: Strands per unit of `across`.
        pixel_across: Size of a pixel in units of `across`.
    """
    total, weight = 0.0, 0.0
    for octave in range(3):
        frequency = count / 3.0**octave
        fade = visible(1.0 / frequency, pixel_across)
        value = noise(across * frequency, along * (2.0 + octave), 7.0 + 13.0 * octave)
        total += fade * (2.0 * value - 1.0)
        weight += 1.0
    return total / weight
