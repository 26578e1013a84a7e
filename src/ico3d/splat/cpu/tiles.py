"""Finds out which splats touch which tile of a picture, and sorts them front to back."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

from dataclasses import dataclass
from math import floor, log, sqrt

import numba
import numpy as np

from ico3d.splat.convention import MIN_ALPHA
from ico3d.splat.cpu.compile import PARTS, kernel

TILE_WIDTH, TILE_HEIGHT = 8, 64
"""Size of a tile in pixels: narrow tiles waste few pixels beside a splat, tall ones save pairs."""

BLOCK = 2
"""Number of neighbouring tiles that are drawn one after the other, as a block.

The tiles of a block together fill whole cache lines of a picture. Every row consists of whole
blocks; the last tile may lie outside of the picture.
"""

VECTOR = 16
"""Number of pixels that are drawn together: two rows of a tile, one or two vector registers."""

SLACK = 0.01
"""Pixels by which a splat's outline is widened, so that rounding errors cut nothing off."""

DIGIT = 11
"""Bits that one pass of the radix sort takes."""


@dataclass
class Tiles:
    """The splats that each tile of a picture shows.

    A *pair* is one splat in one tile. All pairs of a splat have consecutive numbers, so that the
    splat's gradient is always summed in the same order, whichever thread computed the parts.

    Attributes:
        width: Image width in pixels.
        height: Image height in pixels.
        first_pair: (N,) int32, number of a splat's first pair.
        end_pair: (N,) int32, number behind a splat's last pair.
        spans: (P, 2) int32, first and end pixel of the tile's rows that the pair's splat touches,
            widened to whole vectors.
        splats: (P,) int32, the splat of each pair.
        first_entry: (tiles + 1,) int32, index into `pairs` at which a tile's entries begin.
        pairs: (P,) int32, numbers of the pairs, tile by tile, front to back.
    """

    width: int
    height: int
    first_pair: np.ndarray
    end_pair: np.ndarray
    spans: np.ndarray
    splats: np.ndarray
    first_entry: np.ndarray
    pairs: np.ndarray


def tiles_across(width: int) -> int:
    """Number of tiles in a row of a picture that is `width` pixels wide."""
    return -(-width // (TILE_WIDTH * BLOCK)) * BLOCK


@kernel()
def _reach(p, b, q, cut, low, high, v_max):
    """Range of v in the ellipse p·u² + b·u·v + q·v² ≤ cut, given that u lies in [low, high].

    Args:
        p: Half the conic's entry of u.
        b: The conic's mixed entry.
        q: Half the conic's entry of v.
        cut: The exponent at which the splat ends.
        low: Least u.
        high: Greatest u.
        v_max: Greatest v of the whole ellipse.

    Returns:
        Least and greatest v; least > greatest where nothing is left.
    """
    tip = -0.5 * b / p * v_max
    top, bottom = min(max(tip, low), high), min(max(-tip, low), high)
    under_top = (b * b - 4 * p * q) * top * top + 4 * q * cut
    under_bottom = (b * b - 4 * p * q) * bottom * bottom + 4 * q * cut
    if under_top < 0 or under_bottom < 0:
        return 1.0, -1.0
    scale = 0.5 / q
    return (-b * bottom - sqrt(under_bottom)) * scale, (-b * top + sqrt(under_top)) * scale


@kernel()
def _span(low, high, tile, count):
    """First and end of the `count` tiles that the pixel range [low, high] touches."""
    return max(0, floor(low / tile)), min(count, floor(high / tile) + 1)


@kernel()
def _columns(mean, conic, cut, extent, row, across):
    """First and end tile that a splat touches in one row of tiles."""
    low = row * TILE_HEIGHT + 0.5 - mean[1] - SLACK
    high = low + TILE_HEIGHT - 1 + 2 * SLACK
    left, right = _reach(0.5 * conic[2], conic[1], 0.5 * conic[0], cut, low, high, extent[0])
    if left > right:
        return 0, 0
    return _span(mean[0] + left - SLACK, mean[0] + right + SLACK, TILE_WIDTH, across)


@kernel()
def _pixels(mean, conic, cut, extent, column, row):
    """First and end pixel within a tile of the rows that a splat touches, in whole vectors."""
    low = column * TILE_WIDTH + 0.5 - mean[0] - SLACK
    high = low + TILE_WIDTH - 1 + 2 * SLACK
    top, bottom = _reach(0.5 * conic[0], conic[1], 0.5 * conic[2], cut, low, high, extent[1])
    if top > bottom:
        return 0, 0
    offset = mean[1] - row * TILE_HEIGHT - 0.5
    first = max(0, floor(offset + top - SLACK) + 1)
    end = min(TILE_HEIGHT, floor(offset + bottom + SLACK) + 1)
    if first >= end:
        return 0, 0
    return first * TILE_WIDTH // VECTOR * VECTOR, -(-end * TILE_WIDTH // VECTOR) * VECTOR


@kernel()
def _box(mean, extent, across, down):
    """The tiles of a splat's box: first and end column, first and end row."""
    across_by, down_by = extent[0] + SLACK, extent[1] + SLACK
    left, right = _span(mean[0] - across_by, mean[0] + across_by, TILE_WIDTH, across)
    top, bottom = _span(mean[1] - down_by, mean[1] + down_by, TILE_HEIGHT, down)
    return left, right, top, bottom


@kernel()
def _most_pairs(means, alphas, extents, across, down, first, end):
    """How many pairs some splats have at most: the tiles of their boxes."""
    total = 0
    for i in range(first, end):
        if alphas[i] > 0:
            left, right, top, bottom = _box(means[i], extents[i], across, down)
            total += max(0, right - left) * max(0, bottom - top)
    return total


@kernel()
def _list(
    means, conics, alphas, extents, across, down, first, end, pair, starts, ends, tiles, spans, of
):
    """Lists the tiles of some splats and the pixels they touch there, from pair `pair` on."""
    for i in range(first, end):
        starts[i] = pair
        if alphas[i] > 0:
            cut = log(alphas[i] / MIN_ALPHA)
            leftmost, rightmost, top, bottom = _box(means[i], extents[i], across, down)
            for row in range(top, bottom):
                left, right = _columns(means[i], conics[i], cut, extents[i], row, across)
                for column in range(max(left, leftmost), min(right, rightmost)):
                    low, high = _pixels(means[i], conics[i], cut, extents[i], column, row)
                    if low < high:
                        tiles[pair], of[pair] = row * across + column, i
                        spans[pair, 0], spans[pair, 1] = low, high
                        pair += 1
        ends[i] = pair


@kernel(parallel=True)
def _rooms(parts, means, alphas, extents, across, down):
    """Where each part of the splats begins to write its pairs (parts + 1,)."""
    rooms, count = np.zeros(parts + 1, np.int64), means.shape[0]
    for part in numba.prange(parts):
        first, end = part * count // parts, (part + 1) * count // parts
        rooms[part + 1] = _most_pairs(means, alphas, extents, across, down, first, end)
    return rooms.cumsum()


@kernel(parallel=True)
def _list_all(rooms, means, conics, alphas, extents, across, down, starts, ends, tiles, spans, of):
    """Lists all splats' tiles, each part of the splats by one thread."""
    parts, count = rooms.size - 1, means.shape[0]
    for part in numba.prange(parts):
        first, end, pair = part * count // parts, (part + 1) * count // parts, rooms[part]
        _list(
            *(means, conics, alphas, extents, across, down),
            *(first, end, pair, starts, ends, tiles, spans, of),
        )


@kernel()
def _order(depths):
    """Indices by ascending depth (radix sort of positive float32 bits; stable)."""
    count = depths.shape[0]
    keys, order = depths.view(np.uint32), np.arange(count).astype(np.uint32)
    keys_out, order_out = np.empty_like(keys), np.empty_like(order)
    for digit in range(3):
        shift, starts = np.uint32(digit * DIGIT), np.zeros((1 << DIGIT) + 1, np.int64)
        mask = np.uint32((1 << DIGIT) - 1)
        for i in range(count):
            starts[((keys[i] >> shift) & mask) + 1] += 1
        for i in range(1 << DIGIT):
            starts[i + 1] += starts[i]
        for i in range(count):
            bucket = (keys[i] >> shift) & mask
            keys_out[starts[bucket]] = keys[i]
            order_out[starts[bucket]] = order[i]
            starts[bucket] += 1
        if digit == 0:
            keys, keys_out = keys_out, np.empty_like(keys)
        else:
            keys, keys_out = keys_out, keys
        order, order_out = order_out, order
    return order


@kernel()
def _fill(order, starts, ends, tiles, first_entry):
    """The pairs by tile, front to back; writes where a tile's begin."""
    for i in range(starts.shape[0]):
        for pair in range(starts[i], ends[i]):
            first_entry[tiles[pair] + 1] += 1
    for tile in range(first_entry.shape[0] - 1):
        first_entry[tile + 1] += first_entry[tile]
    following, pairs = first_entry.copy(), np.empty(first_entry[-1], np.int32)
    for k in range(order.shape[0]):
        i = order[k]
        for pair in range(starts[i], ends[i]):
            pairs[following[tiles[pair]]] = pair
            following[tiles[pair]] += 1
    return pairs


def bin_splats(
    means2d: np.ndarray,
    conics: np.ndarray,
    alphas: np.ndarray,
    depths: np.ndarray,
    extents: np.ndarray,
    width: int,
    height: int,
) -> Tiles:
    """Finds each tile's splats and sorts them front to back.

    Args:
        means2d: (N, 2) float32 pixels.
        conics: (N, 3) float32, entries xx, xy, yy of the inverse 2D covariances.
        alphas: (N,) float32 opacities; splats with 0 are skipped.
        depths: (N,) float32 metres; not negative where `alphas` is above 0.
        extents: (N, 2) float32 half sizes of the splats' bounding boxes in pixels.
        width: Image width in pixels.
        height: Image height in pixels.

    Returns:
        The tiles.
    """
    across, down = tiles_across(width), -(-height // TILE_HEIGHT)
    rooms = _rooms(PARTS, means2d, alphas, extents, across, down)
    most, count = rooms[-1], len(means2d)
    tiles, splats = np.empty(most, np.int32), np.empty(most, np.int32)
    spans = np.empty((most, 2), np.int32)
    starts, ends = np.empty(count, np.int32), np.empty(count, np.int32)
    _list_all(
        rooms, means2d, conics, alphas, extents, across, down, starts, ends, tiles, spans, splats
    )
    first_entry = np.zeros(across * down + 1, np.int32)
    pairs = _fill(_order(depths), starts, ends, tiles, first_entry)
    return Tiles(width, height, starts, ends, spans, splats, first_entry, pairs)
