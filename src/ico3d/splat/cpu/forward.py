"""Splats to pixels: alpha compositing, tile by tile, front to back."""

import numba
import numpy as np

from ico3d.splat import convention
from ico3d.splat.cpu.compile import kernel
from ico3d.splat.cpu.tiles import TILE, Tiles

PIXELS = TILE * TILE
CHECK = 32
"""After so many splats a tile looks whether all of its pixels are finished."""

MIN_ALPHA = np.float32(convention.MIN_ALPHA)
MAX_ALPHA = np.float32(convention.MAX_ALPHA)
MIN_TRANSMITTANCE = np.float32(convention.MIN_TRANSMITTANCE)
ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
FARTHEST = np.float32(8)
STEP = np.float32(-1 / 16)
E2, E3, E4 = np.float32(1 / 2), np.float32(1 / 6), np.float32(1 / 24)
E5, E6 = np.float32(1 / 120), np.float32(1 / 720)


@kernel()
def falloff(exponent):
    """exp(−exponent) as the 16th power of a polynomial: unlike a call, it vectorises.

    Exponents above 8, where every splat has ended, count as 8.
    """
    y = min(exponent, FARTHEST) * STEP
    power = ONE + y * (ONE + y * (E2 + y * (E3 + y * (E4 + y * (E5 + y * E6)))))
    power *= power
    power *= power
    power *= power
    return power * power


@kernel()
def pixel_positions(xs, ys):
    """Writes the pixel centres of a tile, relative to its first pixel's centre."""
    for p in range(PIXELS):
        xs[p] = np.float32(p % TILE)
        ys[p] = np.float32(p // TILE)


@kernel()
def finished(light):
    """Whether no pixel of a tile lets light through any more."""
    most = -ONE
    for p in range(light.size):
        most = max(most, light[p])
    return most < ZERO


@kernel()
def _blend(light, red, green, blue, xs, ys, splat, left, top):
    """Composites one splat into rows of a tile.

    `light` is the transmittance so far, negative where the pixel is finished. There is no branch:
    LLVM turns the conditional values into masks.
    """
    mx, my = splat[0] - left, splat[1] - top
    xx, xy, yy, opacity = splat[2], splat[3], splat[4], splat[5]
    r, g, b = splat[6], splat[7], splat[8]
    for p in range(light.size):
        dx, dy = xs[p] - mx, ys[p] - my
        alpha = min(opacity * falloff(dx * (xx * dx + xy * dy) + yy * dy * dy), MAX_ALPHA)
        alpha = alpha if alpha >= MIN_ALPHA else ZERO
        before = light[p]
        after = before * (ONE - alpha)
        weight = alpha * before if after > MIN_TRANSMITTANCE else ZERO
        red[p] += weight * r
        green[p] += weight * g
        blue[p] += weight * b
        light[p] = after if after > MIN_TRANSMITTANCE else -abs(before)


@kernel()
def _write(state, left, top, image, light):
    """Writes a tile into the image."""
    for y in range(min(TILE, image.shape[0] - top)):
        for x in range(min(TILE, image.shape[1] - left)):
            p = y * TILE + x
            light[top + y, left + x] = abs(state[0, p])
            for k in range(3):
                image[top + y, left + x, k] = state[1 + k, p]


@kernel()
def _draw(tile, across, records, rows, splats, entries, image, light):
    """Draws one tile from its entries."""
    state = np.zeros((6, PIXELS), np.float32)
    state[0] = ONE
    pixel_positions(state[4], state[5])
    left, top = (tile % across) * TILE, (tile // across) * TILE
    left_center, top_center = np.float32(left) + HALF, np.float32(top) + HALF
    for k in range(entries.size):
        pair = entries[k]
        low, high = rows[pair, 0] * TILE, rows[pair, 1] * TILE
        _blend(
            state[0, low:high],
            state[1, low:high],
            state[2, low:high],
            state[3, low:high],
            state[4, low:high],
            state[5, low:high],
            records[splats[pair]],
            left_center,
            top_center,
        )
        if k % CHECK == CHECK - 1 and finished(state[0]):
            break
    _write(state, left, top, image, light)


@kernel(parallel=True)
def _draw_all(across, records, rows, splats, first_entry, pairs, image, light):
    for tile in numba.prange(first_entry.size - 1):
        entries = pairs[first_entry[tile] : first_entry[tile + 1]]
        _draw(tile, across, records, rows, splats, entries, image, light)


def splat_records(
    means2d: np.ndarray, conics: np.ndarray, alphas: np.ndarray, colors: np.ndarray
) -> np.ndarray:
    """What a tile reads of each splat, side by side in memory.

    Returns:
        (N, 9) float32: mean (2), ½ conic xx, conic xy, ½ conic yy, opacity, colour (3).
    """
    records = np.empty((len(means2d), 9), np.float32)
    records[:, 0:2] = means2d
    records[:, 2:5] = conics
    records[:, 2:5:2] *= 0.5
    records[:, 5] = alphas
    records[:, 6:9] = colors
    return records


def draw(records: np.ndarray, tiles: Tiles) -> tuple[np.ndarray, np.ndarray]:
    """Draws splats.

    Args:
        records: (N, 9) of `splat_records`.
        tiles: Of the same splats.

    Returns:
        Image (H, W, 3) float32 on black, and the transmittance (H, W) that is left.
    """
    image = np.empty((tiles.height, tiles.width, 3), np.float32)
    light = np.empty((tiles.height, tiles.width), np.float32)
    across = -(-tiles.width // TILE)
    _draw_all(
        across, records, tiles.rows, tiles.splats, tiles.first_entry, tiles.pairs, image, light
    )
    return image, light
