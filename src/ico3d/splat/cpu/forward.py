"""Draws splats into pixels: alpha compositing, tile by tile, splats front to back."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

from math import e, log2, sqrt

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat import convention
from ico3d.splat.cpu.compile import kernel, subroutine
from ico3d.splat.cpu.tiles import BLOCK, TILE_HEIGHT, TILE_WIDTH, Tiles, unpack_rows

PIXELS = TILE_WIDTH * TILE_HEIGHT
PLANE = BLOCK * PIXELS + 48
"""Numbers from one plane of a block's state to the next; the state consists of several planes.

The padding keeps planes from lying a multiple of 4096 bytes apart, where the processor's store
buffer would mistake one plane for another.
"""

CHECK = 32
"""Number of splats after which a tile checks whether all of its pixels are finished."""

LEAST = np.float32(log2(convention.MIN_ALPHA))
"""A splat ends where the binary logarithm of its alpha falls below this."""
MAX_ALPHA = np.float32(convention.MAX_ALPHA)
MIN_TRANSMITTANCE = np.float32(convention.MIN_TRANSMITTANCE)
ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)

P1, P2, P3, P4, P5 = map(np.float32, (0.69314372, 0.24018014, 0.05529736, 0.0092058, 0.0009449))
"""Coefficients of the polynomial that is nearest to 2^x for x in (−1, 0], after the constant 1.

Its relative error is at most 2.1e-7, with the rounding of float32.
"""
LOG2_E = log2(e)
MANTISSA = 23
"""Bits of a float32 below its exponent."""


@kernel()
def power_of_two(x):
    """2^x for −126 < x ≤ 0, which vectorises, unlike a call of exp; anything for smaller x."""
    whole = np.int32(x)
    part = x - np.float32(whole)
    power = ONE + part * (P1 + part * (P2 + part * (P3 + part * (P4 + part * P5))))
    bits = np.float32(power).view(np.int32) + (whole << np.int32(MANTISSA))
    return np.int32(bits).view(np.float32)


@subroutine()
def finished(state):
    """Whether every pixel of the tile at the start of `state` has used up its transmittance."""
    for y in range(TILE_HEIGHT):
        left = np.int32(0)
        for x in range(TILE_WIDTH):
            left += np.int32(state[y * TILE_WIDTH + x] > ZERO)
        if left > 0:
            return False
    return True


@subroutine()
def _blend(state, first, end, splat):
    """Composites one splat into the rows from `first` to `end` of a tile.

    The planes of `state` follow at fixed distances, so that LLVM knows that they do not overlap:
    transmittance so far (negative where the pixel is finished), red, green, blue. There is no
    branch: LLVM turns the conditional values into masks, and a row into one vector. Indices are
    unsigned, because numba would look for negative ones.
    """
    mx, my, by_x, by_y, rest, top = splat[0], splat[1], splat[2], splat[3], splat[4], splat[5]
    r, g, b = splat[6], splat[7], splat[8]
    for y in range(first, end):
        dy = np.float32(y) - my
        shift, most = by_y * dy, top - rest * dy * dy
        for x in range(np.uint64(TILE_WIDTH)):
            p = y * np.uint64(TILE_WIDTH) + x
            across = by_x * (np.float32(x) - mx) + shift
            log_alpha = most - across * across
            alpha = min(power_of_two(log_alpha), MAX_ALPHA)
            before = state[p]
            weight = alpha * before if log_alpha >= LEAST else ZERO
            after = before - weight
            weight = weight if after > MIN_TRANSMITTANCE else ZERO
            state[p] = after if after > MIN_TRANSMITTANCE else -abs(before)
            state[np.uint64(PLANE) + p] += weight * r
            state[np.uint64(2 * PLANE) + p] += weight * g
            state[np.uint64(3 * PLANE) + p] += weight * b


@subroutine()
def window(image, block, left, across):
    """The part of an image (H, W, ...) that a block of a band covers, which begins at `left`."""
    x, y = (left + block * BLOCK % across) * TILE_WIDTH, block * BLOCK // across * TILE_HEIGHT
    return image[y : y + TILE_HEIGHT, x : x + BLOCK * TILE_WIDTH]


@subroutine()
def first_center(tile, left, across):
    """Pixel coordinates of the centre of the first pixel of a band's tile."""
    x, y = (left + tile % across) * TILE_WIDTH, tile // across * TILE_HEIGHT
    return np.float32(x) + HALF, np.float32(y) + HALF


@subroutine()
def _write_row(state, width, image, light):
    """Writes one row of a tile, whose state begins here."""
    for x in range(width):
        light[x] = abs(state[x])
        image[x, 0] = state[PLANE + x]
        image[x, 1] = state[2 * PLANE + x]
        image[x, 2] = state[3 * PLANE + x]


@subroutine()
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


@subroutine()
def load(records, entries, center, splats):
    """Copies the records of some entries into `splats`, relative to the tile's first pixel.

    A loop of its own, so that the processor waits for several records at the same time.
    """
    for k in range(entries.shape[0]):
        record, splat = records[entries[k, 0]], splats[k]
        x, y = record[0] - center[0], record[1] - center[1]
        by_x, by_y, rest, top = record[2], record[3], record[4], record[5]
        r, g, b = record[6], record[7], record[8]
        splat[0], splat[1], splat[2], splat[3], splat[4], splat[5] = x, y, by_x, by_y, rest, top
        splat[6], splat[7], splat[8] = r, g, b


@subroutine()
def _draw(state, records, entries, center, splats):
    """Draws one tile, whose state begins here, from its entries."""
    for start in range(0, entries.shape[0], CHECK):
        some = entries[start : start + CHECK]
        load(records, some, center, splats)
        for k in range(some.shape[0]):
            first, end = unpack_rows(some[k, 1])
            _blend(state, first, end, splats[k])
        if finished(state):
            break


@kernel(parallel=True)
def _draw_all(hands, left, across, records, first_entry, entries, image, light):
    """Draws all blocks of a band; each thread takes every `hands`-th."""
    for hand in numba.prange(hands):
        state, splats = np.empty(4 * PLANE, np.float32), np.empty((CHECK, 9), np.float32)
        for block in range(hand, first_entry.size // BLOCK, hands):
            state[:PLANE] = ONE
            state[PLANE:] = ZERO
            for i in range(BLOCK):
                tile = block * BLOCK + i
                some = entries[first_entry[tile] : first_entry[tile + 1]]
                center = first_center(tile, left, across)
                _draw(state[i * PIXELS :], records, some, center, splats)
            _write(state, window(image, block, left, across), window(light, block, left, across))


@kernel()
def _pack(means2d, conics, alphas, colors, records):
    for i in range(records.shape[0]):
        records[i, 0], records[i, 1] = means2d[i, 0], means2d[i, 1]
        by_x = sqrt(0.5 * LOG2_E * conics[i, 0])
        by_y = 0.5 * LOG2_E * conics[i, 1] / by_x
        records[i, 2], records[i, 3] = by_x, by_y
        records[i, 4] = 0.5 * LOG2_E * conics[i, 2] - by_y * by_y
        records[i, 5] = log2(alphas[i])
        for k in range(3):
            records[i, 6 + k] = colors[i, k]


def splat_records(
    means2d: np.ndarray, conics: np.ndarray, alphas: np.ndarray, colors: np.ndarray
) -> np.ndarray:
    """Packs what a tile reads of each splat side by side in memory.

    The binary logarithm of alpha is written as l − (a·dx + b·dy)² − c·dy² (the conic's Cholesky
    factors): no large numbers cancel, and within a row only a·dx differs from pixel to pixel.

    Args:
        means2d: (N, 2) pixels.
        conics: (N, 3) entries xx, xy, yy of the inverse 2D covariances.
        alphas: (N,) opacities.
        colors: (N, 3).

    Returns:
        (N, 9) float32: mean (2), a, b, c, l, colour (3).
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
    hands = numba.get_num_threads()  # not in the kernel, which could not be cached then
    for band in tiles.bands():
        left, across, first_entry = band.left, band.across, band.first_entry
        _draw_all(hands, left, across, records, first_entry, band.entries, image, light)
    return image, light
