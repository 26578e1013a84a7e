"""Gradients of the compositing: tiles once more, front to back."""

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
    ZERO,
    falloff,
    finished,
    pixel_positions,
)
from ico3d.splat.cpu.tiles import TILE_HEIGHT, TILE_WIDTH, Tiles, dealt, dealt_turns

GRADIENTS = 9
"""Per splat: mean (2), conic (3), opacity, colour (3)."""


@kernel()
def _gather(light, rest, red, green, blue, xs, ys, splat, left, top, out):
    """Sums one splat's gradients over rows of a tile.

    `light` is the transmittance so far (negative where finished), `rest` the loss's derivative
    by everything from here to the background, weighted as it shows. With c·g = colour · pixel
    gradient, dL/dα = T·c·g − rest behind it / (1 − α).
    """
    mx, my = splat[0] - left, splat[1] - top
    xx, xy, yy, opacity = splat[2], splat[3], splat[4], splat[5]
    r, g, b = splat[6], splat[7], splat[8]
    sum_r, sum_g, sum_b, sum_s = ZERO, ZERO, ZERO, ZERO
    sum_x, sum_y, sum_xx, sum_xy, sum_yy = ZERO, ZERO, ZERO, ZERO, ZERO
    for p in range(light.size):
        dx, dy = xs[p] - mx, ys[p] - my
        raw = opacity * falloff(dx * (xx * dx + xy * dy) + yy * dy * dy)
        alpha = min(raw, MAX_ALPHA)
        alpha = alpha if alpha >= MIN_ALPHA else ZERO
        before, clear = light[p], ONE - alpha
        after = before * clear
        alpha = alpha if after > MIN_TRANSMITTANCE else ZERO
        light[p] = after if after > MIN_TRANSMITTANCE else -abs(before)
        weight = alpha * before
        sum_r += weight * red[p]
        sum_g += weight * green[p]
        sum_b += weight * blue[p]
        seen = weight * (r * red[p] + g * green[p] + b * blue[p])
        behind = rest[p] - seen
        rest[p] = behind
        by_exponent = seen - alpha * behind / clear
        by_exponent = by_exponent if raw <= MAX_ALPHA else ZERO
        by_x, by_y = by_exponent * dx, by_exponent * dy
        sum_s += by_exponent
        sum_x += by_x
        sum_y += by_y
        sum_xx += by_x * dx
        sum_xy += by_x * dy
        sum_yy += by_y * dy
    out[0] = (xx + xx) * sum_x + xy * sum_y
    out[1] = xy * sum_x + (yy + yy) * sum_y
    out[2] = -HALF * sum_xx
    out[3] = -sum_xy
    out[4] = -HALF * sum_yy
    out[5] = sum_s / opacity
    out[6] = sum_r
    out[7] = sum_g
    out[8] = sum_b


@kernel()
def _read(state, left, top, image, light, g_image, g_light):
    """Reads a tile's pixel gradients and what the loss owes to the whole pixel."""
    for y in range(min(TILE_HEIGHT, image.shape[0] - top)):
        for x in range(min(TILE_WIDTH, image.shape[1] - left)):
            p, row, column = y * TILE_WIDTH + x, top + y, left + x
            rest = g_light[row, column] * light[row, column]
            for k in range(3):
                state[2 + k, p] = g_image[row, column, k]
                rest += g_image[row, column, k] * image[row, column, k]
            state[1, p] = rest


@kernel()
def _collect(tile, across, records, rows, splats, entries, image, light, g_image, g_light, parts):
    """Writes the gradients of one tile's pairs."""
    state = np.zeros((7, PIXELS), np.float32)
    state[0] = ONE
    pixel_positions(state[5], state[6])
    left, top = (tile % across) * TILE_WIDTH, (tile // across) * TILE_HEIGHT
    left_center, top_center = np.float32(left) + HALF, np.float32(top) + HALF
    _read(state, left, top, image, light, g_image, g_light)
    done = False
    for k in range(entries.size):
        pair = entries[k]
        if done:
            parts[pair] = ZERO
            continue
        low, high = rows[pair, 0] * TILE_WIDTH, rows[pair, 1] * TILE_WIDTH
        _gather(
            state[0, low:high],
            state[1, low:high],
            state[2, low:high],
            state[3, low:high],
            state[4, low:high],
            state[5, low:high],
            state[6, low:high],
            records[splats[pair]],
            left_center,
            top_center,
            parts[pair],
        )
        done = k % CHECK == CHECK - 1 and finished(state[0])


@kernel(parallel=True)
def _collect_all(
    hands, across, records, rows, splats, first_entry, pairs, image, light, g_image, g_light, parts
):
    count = first_entry.size - 1
    for turn in numba.prange(dealt_turns(hands, count)):
        tile = dealt(turn, hands, count)
        if tile < count:
            entries = pairs[first_entry[tile] : first_entry[tile + 1]]
            _collect(
                tile, across, records, rows, splats, entries, image, light, g_image, g_light, parts
            )


@kernel()
def _sum(first_pair, parts, gradients):
    """Sums each splat's pairs in their order."""
    for i in range(first_pair.size - 1):
        for k in range(GRADIENTS):
            gradients[i, k] = ZERO
        for pair in range(first_pair[i], first_pair[i + 1]):
            for k in range(GRADIENTS):
                gradients[i, k] += parts[pair, k]


def draw_backward(
    records: np.ndarray,
    tiles: Tiles,
    image: np.ndarray,
    light: np.ndarray,
    g_image: np.ndarray,
    g_light: np.ndarray,
) -> np.ndarray:
    """Gradients of `draw`.

    Args:
        records: (N, 9), as drawn.
        tiles: As drawn.
        image: (H, W, 3) that `draw` returned.
        light: (H, W) that `draw` returned.
        g_image: (H, W, 3) gradient with respect to the image.
        g_light: (H, W) gradient with respect to the transmittance.

    Returns:
        (N, 9) float32: mean (2), conic (3), opacity, colour (3).
    """
    parts = np.empty((len(tiles.pairs), GRADIENTS), np.float32)
    gradients = np.empty((len(records), GRADIENTS), np.float32)
    across = -(-tiles.width // TILE_WIDTH)
    _collect_all(
        numba.get_num_threads(),
        across,
        records,
        tiles.rows,
        tiles.splats,
        tiles.first_entry,
        tiles.pairs,
        image,
        light,
        g_image,
        g_light,
        parts,
    )
    _sum(tiles.first_pair, parts, gradients)
    return gradients
