"""Numba kernels of a depth map that repeats: drawing spheres into it, and looking it up."""

import math

import numpy as np

from ico3d.splat.cpu.compile import kernel


@kernel()
def draw(spheres, radius, texel, depths):
    """Keeps at each texel how far towards the lamp the nearest sphere reaches.

    Args:
        spheres: (M, 3) centres across, up and towards the lamp, metres.
        radius: Of the spheres, texels.
        texel: Metres.
        depths: (S, S) metres, a power of two along its sides; changed in place.
    """
    last = len(depths) - 1
    square = radius * radius
    for i in range(len(spheres)):
        x, y = spheres[i, 0] / texel, spheres[i, 1] / texel
        for row in range(math.ceil(y - radius), math.floor(y + radius) + 1):
            for column in range(math.ceil(x - radius), math.floor(x + radius) + 1):
                left = square - (column - x) ** 2 - (row - y) ** 2
                if left >= 0:
                    depth = spheres[i, 2] + texel * math.sqrt(left)
                    # Of negative numbers, too, these bits are the remainder.
                    at = row & last, column & last
                    depths[at] = max(depths[at], np.float32(depth))


@kernel()
def look_up(places, depths, texel, bias, edge, shares):
    """Writes which share of the 4 × 4 texels about each place is not before it.

    Args:
        places: (N, 3) across, up and towards the lamp, metres.
        depths: (S, S) of `draw`.
        texel: Metres.
        bias: Metres behind the nearest sphere that are lit.
        edge: Metres about that over which light begins.
        shares: (N,) from 0 to 1; written.
    """
    last = len(depths) - 1
    for i in range(len(places)):
        x, y = places[i, 0] / texel, places[i, 1] / texel
        left, low = math.floor(x), math.floor(y)
        u, v = x - left, y - low
        share = np.float32(0)
        for down in range(-1, 3):
            weight = 1 - abs(v - down) / 2
            for right in range(-1, 3):
                nearest = depths[(low + down) & last, (left + right) & last]
                clear = min(max((places[i, 2] + bias - nearest) / edge + 0.5, 0), 1)
                share += weight * clear * (1 - abs(u - right) / 2)
        shares[i] = share / 4
