"""Gradients of the compositing; visits the tiles a second time, splats front to back."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

from math import exp2, log

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.cpu.compile import kernel, subroutine
from ico3d.splat.cpu.forward import (
    CHECK,
    HALF,
    LEAST,
    MAX_ALPHA,
    MIN_TRANSMITTANCE,
    ONE,
    PIXELS,
    PLANE,
    ZERO,
    finished,
    first_center,
    load,
    power_of_two,
    window,
)
from ico3d.splat.cpu.tiles import BLOCK, TILE_WIDTH, Band, Tiles, unpack_rows

GRADIENTS = 9
"""Gradients per splat: mean (2), conic (3), opacity, colour (3)."""
ABSOLUTE = 2
"""Further gradients on request: the mean's two, summed over pixels as absolute values."""
TWICE_LOG_2 = np.float32(2 * log(2))


@subroutine()
def _pixel_positions(state, plane):
    """Writes pixel centres, relative to the tile's first pixel, into two planes of a state."""
    for p in range(BLOCK * PIXELS):
        state[plane * PLANE + p] = np.float32(p % TILE_WIDTH)
        state[(plane + 1) * PLANE + p] = np.float32(p % PIXELS // TILE_WIDTH)


@subroutine()
def _gather(state, first, end, splat, absolute, out):
    """Sums one splat's gradients over the rows from `first` to `end` of a tile.

    The planes of `state` (see `forward._blend`): transmittance so far (negative where finished),
    the loss's derivative by everything from here to the background, weighted as it shows (rest),
    the pixel gradient's red, green, blue, then x and y. With c·g = colour · pixel gradient,
    dL/dα = T·c·g − rest behind it / (1 − α). `out` gets sums of α·dL/dα: by 1, dx, dy, dx², dx·dy,
    dy²; the colour's gradient; with `absolute` those of the mean, as `_sum` would make them.
    """
    mx, my, by_x, by_y, rest, top = splat[0], splat[1], splat[2], splat[3], splat[4], splat[5]
    r, g, b = splat[6], splat[7], splat[8]
    sum_r, sum_g, sum_b, sum_1 = ZERO, ZERO, ZERO, ZERO
    sum_x, sum_y, sum_xx, sum_xy, sum_yy = ZERO, ZERO, ZERO, ZERO, ZERO
    absolute_x, absolute_y = ZERO, ZERO
    for p in range(first * np.uint64(TILE_WIDTH), end * np.uint64(TILE_WIDTH)):
        red, green = state[np.uint64(2 * PLANE) + p], state[np.uint64(3 * PLANE) + p]
        blue = state[np.uint64(4 * PLANE) + p]
        dx, dy = state[np.uint64(5 * PLANE) + p] - mx, state[np.uint64(6 * PLANE) + p] - my
        across = by_x * dx + by_y * dy
        log_alpha = top - rest * dy * dy - across * across
        raw = power_of_two(log_alpha)
        before = state[p]
        weight = min(raw, MAX_ALPHA) * before if log_alpha >= LEAST else ZERO
        after = before - weight
        weight = weight if after > MIN_TRANSMITTANCE else ZERO
        state[p] = after if after > MIN_TRANSMITTANCE else -abs(before)
        sum_r += weight * red
        sum_g += weight * green
        sum_b += weight * blue
        seen = weight * (r * red + g * green + b * blue)
        behind = state[np.uint64(PLANE) + p] - seen
        state[np.uint64(PLANE) + p] = behind
        by_exponent = seen - weight * behind / after
        by_exponent = by_exponent if raw <= MAX_ALPHA else ZERO
        sum_1 += by_exponent
        sum_x += by_exponent * dx
        sum_y += by_exponent * dy
        sum_xx += by_exponent * dx * dx
        sum_xy += by_exponent * dx * dy
        sum_yy += by_exponent * dy * dy
        if absolute:  # the same for all pixels: LLVM makes two loops of it
            absolute_x += abs(by_exponent * across)
            absolute_y += abs(by_exponent * (by_y * across + rest * dy))
    out[0], out[1], out[2], out[3], out[4] = sum_x, sum_y, sum_xx, sum_xy, sum_yy
    out[5], out[6], out[7], out[8] = sum_1, sum_r, sum_g, sum_b
    if absolute:
        out[9], out[10] = TWICE_LOG_2 * by_x * absolute_x, TWICE_LOG_2 * absolute_y


@subroutine()
def _read(state, image, light, g_image, g_light):
    """Reads a block's pixel gradients and what the loss owes to the whole pixel."""
    state[:PLANE] = ONE
    state[PLANE : 5 * PLANE] = ZERO  # nothing is owed outside of the picture
    for y in range(light.shape[0]):
        for x in range(light.shape[1]):
            p = x // TILE_WIDTH * PIXELS + y * TILE_WIDTH + x % TILE_WIDTH
            red, green, blue = g_image[y, x, 0], g_image[y, x, 1], g_image[y, x, 2]
            own = red * image[y, x, 0] + green * image[y, x, 1] + blue * image[y, x, 2]
            state[PLANE + p] = g_light[y, x] * light[y, x] + own
            state[2 * PLANE + p] = red
            state[3 * PLANE + p] = green
            state[4 * PLANE + p] = blue


@subroutine()
def _collect(state, records, entries, center, splats, parts):
    """Writes the gradients of the pairs of one tile, whose state begins here."""
    done, absolute = False, parts.shape[1] > GRADIENTS
    for start in range(0, entries.shape[0], CHECK):
        some = entries[start : start + CHECK]
        if done:
            for k in range(some.shape[0]):
                parts[some[k, 2]] = ZERO
            continue
        load(records, some, center, splats)
        for k in range(some.shape[0]):
            first, end = unpack_rows(some[k, 1])
            _gather(state, first, end, splats[k], absolute, parts[some[k, 2]])
        done = finished(state)


@kernel(parallel=True)
def _collect_all(
    hands, left, across, records, first_entry, entries, image, light, g_image, g_light, parts
):
    """Writes the gradients of all pairs of a band; each thread takes every `hands`-th block."""
    for hand in numba.prange(hands):
        state, splats = np.empty(7 * PLANE, np.float32), np.empty((CHECK, 9), np.float32)
        _pixel_positions(state, 5)
        for block in range(hand, first_entry.size // BLOCK, hands):
            _read(
                state,
                window(image, block, left, across),
                window(light, block, left, across),
                window(g_image, block, left, across),
                window(g_light, block, left, across),
            )
            for i in range(BLOCK):
                tile = block * BLOCK + i
                some = entries[first_entry[tile] : first_entry[tile + 1]]
                center = first_center(tile, left, across)
                _collect(state[i * PIXELS :], records, some, center, splats, parts)


@kernel(parallel=True)
def _sum(order, first_pair, end_pair, records, parts, gradients):
    """Sums each splat's pairs in their order, and makes gradients of what `_gather` found."""
    for k in numba.prange(order.size):
        splat, out = records[order[k]], gradients[order[k]]
        for j in range(parts.shape[1]):
            out[j] = ZERO
        for pair in range(first_pair[k], end_pair[k]):
            for j in range(parts.shape[1]):
                out[j] += parts[pair, j]
        if first_pair[k] == end_pair[k]:
            continue  # its record may not be finite
        across = splat[2] * out[0] + splat[3] * out[1]
        out[0] = TWICE_LOG_2 * splat[2] * across
        out[1] = TWICE_LOG_2 * (splat[3] * across + splat[4] * out[1])
        out[2], out[3], out[4] = -HALF * out[2], -out[3], -HALF * out[4]
        out[5] *= exp2(-splat[5])


def draw_backward(
    records: np.ndarray,
    tiles: Tiles,
    image: np.ndarray,
    light: np.ndarray,
    g_image: np.ndarray,
    g_light: np.ndarray,
    absolute: bool = False,
) -> np.ndarray:
    """Gradients of `draw`.

    Args:
        records: (N, 9) array that was given to `draw`.
        tiles: The tiles that were given to `draw`.
        image: (H, W, 3) that `draw` returned.
        light: (H, W) transmittance that `draw` returned.
        g_image: (H, W, 3) gradient with respect to the image.
        g_light: (H, W) gradient with respect to the transmittance.
        absolute: Whether the mean's gradient is also summed over pixels as absolute values.

    Returns:
        (N, 9) float32: mean (2), conic (3), opacity, colour (3); with `absolute` (N, 11).
    """
    columns = GRADIENTS + (ABSOLUTE if absolute else 0)
    found = (
        _band_gradients(records, tiles, band, image, light, g_image, g_light, columns)
        for band in tiles.bands()
    )
    gradients = next(found)
    for further in found:
        gradients += further
    return gradients


def _band_gradients(
    records: np.ndarray,
    tiles: Tiles,
    band: Band,
    image: np.ndarray,
    light: np.ndarray,
    g_image: np.ndarray,
    g_light: np.ndarray,
    columns: int,
) -> np.ndarray:
    """What `draw_backward` returns, of the pixels of one band."""
    parts = np.empty((band.room, columns), np.float32)
    gradients = np.empty((len(records), columns), np.float32)
    left, across, hands = band.left, band.across, numba.get_num_threads()
    first_entry, entries = band.first_entry, band.entries
    _collect_all(
        hands, left, across, records, first_entry, entries, image, light, g_image, g_light, parts
    )
    _sum(tiles.order, band.first_pair, band.end_pair, records, parts, gradients)
    return gradients
