"""Gradients of the compositing; visits the tiles a second time, splats front to back."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

import numba
import numpy as np

from ico3d.splat.cpu.compile import kernel
from ico3d.splat.cpu.forward import (
    CHECK,
    HALF,
    MAX_ALPHA,
    MIN_ALPHA,
    MIN_TRANSMITTANCE,
    ONE,
    PIXELS,
    PLANE,
    ZERO,
    falloff,
    finished,
    first_center,
    pixel_positions,
    window,
)
from ico3d.splat.cpu.tiles import BLOCK, TILE_WIDTH, Tiles, tiles_across

GRADIENTS = 9
"""Gradients per splat: mean (2), conic (3), opacity, colour (3)."""
ABSOLUTE = 2
"""Further gradients on request: the mean's two, summed over pixels as absolute values."""


@kernel()
def _gather(state, count, splat, left, top, absolute, out):
    """Sums one splat's gradients over the next `count` pixels of a tile.

    The planes of `state` (see `forward._blend`): transmittance so far (negative where finished),
    the loss's derivative by everything from here to the background, weighted as it shows (rest),
    the pixel gradient's red, green, blue, then x and y. With c·g = colour · pixel gradient,
    dL/dα = T·c·g − rest behind it / (1 − α).
    """
    mx, my = splat[0] - left, splat[1] - top
    xx, xy, yy, opacity = splat[2], splat[3], splat[4], splat[5]
    r, g, b = splat[6], splat[7], splat[8]
    sum_r, sum_g, sum_b, sum_s = ZERO, ZERO, ZERO, ZERO
    sum_x, sum_y, sum_xx, sum_xy, sum_yy = ZERO, ZERO, ZERO, ZERO, ZERO
    absolute_x, absolute_y = ZERO, ZERO
    for p in range(count):
        red, green, blue = (
            state[2 * PLANE + p],
            state[3 * PLANE + p],
            state[4 * PLANE + p],
        )
        dx, dy = state[5 * PLANE + p] - mx, state[6 * PLANE + p] - my
        raw = opacity * falloff(dx * (xx * dx + xy * dy) + yy * dy * dy)
        alpha = min(raw, MAX_ALPHA)
        alpha = alpha if alpha >= MIN_ALPHA else ZERO
        before, clear = state[p], ONE - alpha
        after = before * clear
        alpha = alpha if after > MIN_TRANSMITTANCE else ZERO
        state[p] = after if after > MIN_TRANSMITTANCE else -abs(before)
        weight = alpha * before
        sum_r += weight * red
        sum_g += weight * green
        sum_b += weight * blue
        seen = weight * (r * red + g * green + b * blue)
        behind = state[PLANE + p] - seen
        state[PLANE + p] = behind
        by_exponent = seen - alpha * behind / clear
        by_exponent = by_exponent if raw <= MAX_ALPHA else ZERO
        by_x, by_y = by_exponent * dx, by_exponent * dy
        sum_s += by_exponent
        sum_x += by_x
        sum_y += by_y
        sum_xx += by_x * dx
        sum_xy += by_x * dy
        sum_yy += by_y * dy
        if absolute:  # the same for all pixels: LLVM makes two loops of it
            absolute_x += abs((xx + xx) * by_x + xy * by_y)
            absolute_y += abs(xy * by_x + (yy + yy) * by_y)
    out[0] = (xx + xx) * sum_x + xy * sum_y
    out[1] = xy * sum_x + (yy + yy) * sum_y
    out[2] = -HALF * sum_xx
    out[3] = -sum_xy
    out[4] = -HALF * sum_yy
    out[5] = sum_s / opacity
    out[6] = sum_r
    out[7] = sum_g
    out[8] = sum_b
    if absolute:
        out[9] = absolute_x
        out[10] = absolute_y


@kernel()
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


@kernel()
def _collect(state, records, spans, splats, entries, center, parts):
    """Writes the gradients of the pairs of one tile, whose state begins here."""
    done = False
    for k in range(entries.size):
        pair = entries[k]
        if done:
            parts[pair] = ZERO
            continue
        low, high = spans[pair]
        splat = records[splats[pair]]
        absolute = parts.shape[1] > GRADIENTS
        _gather(state[low:], high - low, splat, center[0], center[1], absolute, parts[pair])
        done = k % CHECK == CHECK - 1 and finished(state)


@kernel(parallel=True)
def _collect_all(
    hands, across, records, spans, splats, first_entry, pairs, image, light, g_image, g_light, parts
):
    """Writes the gradients of all pairs; each thread takes every `hands`-th block."""
    for hand in numba.prange(hands):
        state = np.empty(7 * PLANE, np.float32)
        pixel_positions(state, 5)
        for block in range(hand, first_entry.size // BLOCK, hands):
            _read(
                state,
                window(image, block, across),
                window(light, block, across),
                window(g_image, block, across),
                window(g_light, block, across),
            )
            for i in range(BLOCK):
                tile = block * BLOCK + i
                entries = pairs[first_entry[tile] : first_entry[tile + 1]]
                center = first_center(tile, across)
                _collect(state[i * PIXELS :], records, spans, splats, entries, center, parts)


@kernel(parallel=True)
def _sum(first_pair, end_pair, parts, gradients):
    """Sums each splat's pairs in their order."""
    for i in numba.prange(first_pair.size):
        for k in range(parts.shape[1]):
            gradients[i, k] = ZERO
        for pair in range(first_pair[i], end_pair[i]):
            for k in range(parts.shape[1]):
                gradients[i, k] += parts[pair, k]


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
    parts = np.empty((len(tiles.splats), columns), np.float32)
    gradients = np.empty((len(records), columns), np.float32)
    across = tiles_across(tiles.width)
    _collect_all(
        numba.get_num_threads(),
        across,
        records,
        tiles.spans,
        tiles.splats,
        tiles.first_entry,
        tiles.pairs,
        image,
        light,
        g_image,
        g_light,
        parts,
    )
    _sum(tiles.first_pair, tiles.end_pair, parts, gradients)
    return gradients
