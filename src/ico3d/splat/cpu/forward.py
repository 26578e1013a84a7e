"""Splats to pixels: alpha compositing, tile by tile, front to back."""

from math import factorial

import numba
import numpy as np

from ico3d.splat import convention
from ico3d.splat.cpu.compile import kernel
from ico3d.splat.cpu.tiles import TILE_HEIGHT, TILE_WIDTH, Tiles, dealt, dealt_turns

PIXELS = TILE_WIDTH * TILE_HEIGHT
CHECK = 32
"""After so many splats a tile looks whether all of its pixels are finished."""

MIN_ALPHA = np.float32(convention.MIN_ALPHA)
MAX_ALPHA = np.float32(convention.MAX_ALPHA)
MIN_TRANSMITTANCE = np.float32(convention.MIN_TRANSMITTANCE)
ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
FARTHEST = np.float32(8)
"""Exponents end here: exp(−8) is under the least alpha, so every splat has ended before."""

E1, E2, E3, E4, E5, E6 = (np.float32((-1 / 16) ** k / factorial(k)) for k in range(1, 7))
"""The Taylor series of exp(−x/16)."""


@kernel()
def falloff(exponent):
    """exp(−exponent) as the 16th power of a polynomial: unlike a call, it vectorises."""
    x = min(exponent, FARTHEST)
    power = ONE + x * (E1 + x * (E2 + x * (E3 + x * (E4 + x * (E5 + x * E6)))))
    power *= power
    power *= power
    power *= power
    return power * power


@kernel()
def pixel_positions(xs, ys):
    """Writes the pixel centres of a tile, relative to its first pixel's centre."""
    for p in range(PIXELS):
        xs[p] = np.float32(p % TILE_WIDTH)
        ys[p] = np.float32(p // TILE_WIDTH)


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
    for y in range(min(TILE_HEIGHT, image.shape[0] - top)):
        for x in range(min(TILE_WIDTH, image.shape[1] - left)):
            p = y * TILE_WIDTH + x
            light[top + y, left + x] = abs(state[0, p])
            for k in range(3):
                image[top + y, left + x, k] = state[1 + k, p]


@kernel()
def _draw(tile, across, records, rows, splats, entries, image, light):
    """Draws one tile from its entries."""
    state = np.zeros((6, PIXELS), np.float32)
    state[0] = ONE
    pixel_positions(state[4], state[5])
    left, top = (tile % across) * TILE_WIDTH, (tile // across) * TILE_HEIGHT
    left_center, top_center = np.float32(left) + HALF, np.float32(top) + HALF
    for k in range(entries.size):
        pair = entries[k]
        low, high = rows[pair, 0] * TILE_WIDTH, rows[pair, 1] * TILE_WIDTH
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
def _draw_all(hands, across, records, rows, splats, first_entry, pairs, image, light):
    count = first_entry.size - 1
    for turn in numba.prange(dealt_turns(hands, count)):
        tile = dealt(turn, hands, count)
        if tile < count:
            entries = pairs[first_entry[tile] : first_entry[tile + 1]]
            _draw(tile, across, records, rows, splats, entries, image, light)


@kernel()
def _pack(means2d, conics, alphas, colors, records):
    for i in range(records.shape[0]):
        records[i, 0], records[i, 1] = means2d[i, 0], means2d[i, 1]
        records[i, 2], records[i, 4] = HALF * conics[i, 0], HALF * conics[i, 2]
        records[i, 3], records[i, 5] = conics[i, 1], alphas[i]
        for k in range(3):
            records[i, 6 + k] = colors[i, k]


def splat_records(
    means2d: np.ndarray, conics: np.ndarray, alphas: np.ndarray, colors: np.ndarray
) -> np.ndarray:
    """What a tile reads of each splat, side by side in memory.

    Returns:
        (N, 9) float32: mean (2), ½ conic xx, conic xy, ½ conic yy, opacity, colour (3).
    """
    records = np.empty((len(means2d), 9), np.float32)
    _pack(means2d, conics, alphas, colors, records)
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
    across = -(-tiles.width // TILE_WIDTH)
    hands = numba.get_num_threads()  # not in the kernel, which could not be cached then
    _draw_all(
        hands,
        across,
        records,
        tiles.rows,
        tiles.splats,
        tiles.first_entry,
        tiles.pairs,
        image,
        light,
    )
    return image, light
