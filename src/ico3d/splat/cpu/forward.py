"""Draws splats into pixels: alpha compositing, tile by tile, splats front to back."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

from math import factorial

import numba
import numpy as np

from ico3d.splat import convention
from ico3d.splat.cpu.compile import kernel
from ico3d.splat.cpu.tiles import BLOCK, TILE_HEIGHT, TILE_WIDTH, VECTOR, Tiles, tiles_across

PIXELS = TILE_WIDTH * TILE_HEIGHT
PLANE = BLOCK * PIXELS + 3 * VECTOR
"""Numbers from one plane of a block's state to the next; the state consists of several planes.

The padding keeps planes from lying a multiple of 4096 bytes apart, where the processor's store
buffer would mistake one plane for another.
"""

CHECK = 32
"""Number of splats after which a tile checks whether all of its pixels are finished."""

MIN_ALPHA = np.float32(convention.MIN_ALPHA)
MAX_ALPHA = np.float32(convention.MAX_ALPHA)
MIN_TRANSMITTANCE = np.float32(convention.MIN_TRANSMITTANCE)
ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
FARTHEST = np.float32(8)
"""Largest exponent that is evaluated: exp(−8) is below MIN_ALPHA, so a splat has ended there."""

E1, E2, E3, E4, E5, E6 = (np.float32((-1 / 16) ** k / factorial(k)) for k in range(1, 7))
"""Coefficients of the Taylor series of exp(−x/16) after the constant 1."""


@kernel()
def falloff(exponent):
    """exp(−exponent) as the 16th power of a polynomial, which vectorises, unlike a call of exp."""
    x = min(exponent, FARTHEST)
    power = ONE + x * (E1 + x * (E2 + x * (E3 + x * (E4 + x * (E5 + x * E6)))))
    power *= power
    power *= power
    power *= power
    return power * power


@kernel()
def pixel_positions(state, plane):
    """Writes pixel centres, relative to the tile's first pixel, into two planes of a state."""
    for p in range(BLOCK * PIXELS):
        state[plane * PLANE + p] = np.float32(p % TILE_WIDTH)
        state[(plane + 1) * PLANE + p] = np.float32(p % PIXELS // TILE_WIDTH)


@kernel()
def finished(state):
    """Whether every pixel of the tile at the start of `state` has used up its transmittance."""
    most = -ONE
    for p in range(PIXELS):
        most = max(most, state[p])
    return most < ZERO


@kernel()
def _blend(state, count, splat, left, top):
    """Composites one splat into the next `count` pixels of a tile.

    The planes of `state` follow at fixed distances, so that LLVM knows that they do not overlap:
    transmittance so far (negative where the pixel is finished), red, green, blue, x, y. There is
    no branch: LLVM turns the conditional values into masks.
    """
    mx, my = splat[0] - left, splat[1] - top
    xx, xy, yy, opacity = splat[2], splat[3], splat[4], splat[5]
    r, g, b = splat[6], splat[7], splat[8]
    for p in range(count):
        dx, dy = state[4 * PLANE + p] - mx, state[5 * PLANE + p] - my
        alpha = min(opacity * falloff(dx * (xx * dx + xy * dy) + yy * dy * dy), MAX_ALPHA)
        alpha = alpha if alpha >= MIN_ALPHA else ZERO
        before = state[p]
        after = before * (ONE - alpha)
        weight = alpha * before if after > MIN_TRANSMITTANCE else ZERO
        state[PLANE + p] += weight * r
        state[2 * PLANE + p] += weight * g
        state[3 * PLANE + p] += weight * b
        state[p] = after if after > MIN_TRANSMITTANCE else -abs(before)


@kernel()
def window(image, block, across):
    """The part of an image (H, W, ...) that a block of tiles covers."""
    left, top = block * BLOCK % across * TILE_WIDTH, block * BLOCK // across * TILE_HEIGHT
    return image[top : top + TILE_HEIGHT, left : left + BLOCK * TILE_WIDTH]


@kernel()
def first_center(tile, across):
    """Pixel coordinates of the centre of a tile's first pixel."""
    left, top = tile % across * TILE_WIDTH, tile // across * TILE_HEIGHT
    return np.float32(left) + HALF, np.float32(top) + HALF


@kernel()
def _write_row(state, width, image, light):
    """Writes one row of a tile, whose state begins here."""
    for x in range(width):
        light[x] = abs(state[x])
        image[x, 0] = state[PLANE + x]
        image[x, 1] = state[2 * PLANE + x]
        image[x, 2] = state[3 * PLANE + x]


@kernel()
def _write(state, image, light):
    """Writes a block into its part of the image."""
    whole = light.shape[1] == BLOCK * TILE_WIDTH
    for y in range(light.shape[0]):
        for i in range(BLOCK):
            row, left = state[i * PIXELS + y * TILE_WIDTH :], i * TILE_WIDTH
            if whole:  # a width that LLVM knows
                _write_row(row, TILE_WIDTH, image[y, left:], light[y, left:])
            else:
                width = min(TILE_WIDTH, light.shape[1] - left)
                _write_row(row, width, image[y, left:], light[y, left:])


@kernel()
def _draw(state, records, spans, splats, entries, center):
    """Draws one tile, whose state begins here, from its entries."""
    for k in range(entries.size):
        pair = entries[k]
        low, high = spans[pair]
        _blend(state[low:], high - low, records[splats[pair]], center[0], center[1])
        if k % CHECK == CHECK - 1 and finished(state):
            break


@kernel(parallel=True)
def _draw_all(hands, across, records, spans, splats, first_entry, pairs, image, light):
    """Draws all blocks; each thread takes every `hands`-th."""
    for hand in numba.prange(hands):
        state = np.empty(6 * PLANE, np.float32)
        pixel_positions(state, 4)
        for block in range(hand, first_entry.size // BLOCK, hands):
            state[:PLANE] = ONE
            state[PLANE : 4 * PLANE] = ZERO
            for i in range(BLOCK):
                tile = block * BLOCK + i
                entries = pairs[first_entry[tile] : first_entry[tile + 1]]
                center = first_center(tile, across)
                _draw(state[i * PIXELS :], records, spans, splats, entries, center)
            _write(state, window(image, block, across), window(light, block, across))


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
    """Packs what a tile reads of each splat side by side in memory.

    Args:
        means2d: (N, 2) pixels.
        conics: (N, 3) entries xx, xy, yy of the inverse 2D covariances.
        alphas: (N,) opacities.
        colors: (N, 3).

    Returns:
        (N, 9) float32: mean (2), ½ conic xx, conic xy, ½ conic yy, opacity, colour (3).
    """
    records = np.empty((len(means2d), 9), np.float32)
    _pack(means2d, conics, alphas, colors, records)
    return records


def draw(records: np.ndarray, tiles: Tiles) -> tuple[np.ndarray, np.ndarray]:
    """Draws splats on black.

    Args:
        records: (N, 9) from `splat_records`.
        tiles: Which of the N splats each tile shows.

    Returns:
        Image (H, W, 3) float32, and the transmittance (H, W) left behind all splats.
    """
    image = np.empty((tiles.height, tiles.width, 3), np.float32)
    light = np.empty((tiles.height, tiles.width), np.float32)
    across = tiles_across(tiles.width)
    hands = numba.get_num_threads()  # not in the kernel, which could not be cached then
    _draw_all(
        hands,
        across,
        records,
        tiles.spans,
        tiles.splats,
        tiles.first_entry,
        tiles.pairs,
        image,
        light,
    )
    return image, light
