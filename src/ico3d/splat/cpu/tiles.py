"""Finds out which splats touch which tile of a picture, and sorts them front to back."""

# pyright: reportMissingParameterType=false, reportUnknownParameterType=false
# pyright: reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownMemberType=false
# (numba finds the types of a kernel's arguments when it is called)

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import floor, log, sqrt

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.convention import MIN_ALPHA
from ico3d.splat.cpu.compile import PARTS, kernel, subroutine

TILE_WIDTH, TILE_HEIGHT = 8, 64
"""Size of a tile in pixels: narrow tiles waste few pixels beside a splat, tall ones save pairs."""

BLOCK = 2
"""Number of neighbouring tiles that are drawn one after the other, as a block.

The tiles of a block together fill whole cache lines of a picture. Every row consists of whole
blocks; the last tile may lie outside of the picture.
"""

ROWS = 128
"""A number of rows above `TILE_HEIGHT`."""

SLACK = 0.01
"""Pixels by which a splat's outline is widened, so that rounding errors cut nothing off."""

DIGIT = 11
"""Bits that one pass of the radix sort takes."""


MOST_PAIRS = 1 << 24
"""Pairs that a band has at most, if it is wider than a block: 0.4 GB while it is made."""


@dataclass
class Band:
    """The splats that each tile shows, in some columns of tiles of a picture.

    A *pair* is one splat in one tile. All pairs of a splat have consecutive numbers, so that the
    splat's gradient is always summed in the same order, whichever thread computed the parts.

    Attributes:
        left: First column of tiles.
        across: Number of columns.
        first_pair: (N,) int32, number of the first pair of each splat, front to back.
        end_pair: (N,) int32, number behind its last pair.
        room: Number behind the last pair of all; some before it stand for no pair.
        first_entry: (tiles + 1,) int32, index into `entries` at which a tile's begin.
        entries: (P, 3) int32, the pairs tile by tile, front to back: splat, the rows of the tile
            that it touches (from `pack_rows`), number of the pair.
    """

    left: int
    across: int
    first_pair: np.ndarray
    end_pair: np.ndarray
    room: int
    first_entry: np.ndarray
    entries: np.ndarray


@dataclass
class Tiles:
    """The splats that each tile of a picture shows, in bands that stand side by side.

    Nearly all pictures are one band. Where splats have so many pairs that they would fill the
    memory, there are several, of which one is kept and the others are made when they are drawn.

    Attributes:
        width: Image width in pixels.
        height: Image height in pixels.
        order: (N,) uint32, the splats front to back.
        splats: (N, 8) float32, what binning reads of them, front to back.
        borders: Columns of tiles at which the bands begin, and the number of columns.
        first: The band at the left.
    """

    width: int
    height: int
    order: np.ndarray
    splats: np.ndarray
    borders: list[int]
    first: Band

    def bands(self) -> Iterator[Band]:
        """All bands, from left to right."""
        yield self.first
        for left, right in pairwise(self.borders[1:]):
            yield _band(self.order, self.splats, left, right, tiles_down(self.height))


def tiles_across(width: int) -> int:
    """Number of tiles in a row of a picture that is `width` pixels wide."""
    return -(-width // (TILE_WIDTH * BLOCK)) * BLOCK


def tiles_down(height: int) -> int:
    """Number of rows of tiles in a picture that is `height` pixels high."""
    return -(-height // TILE_HEIGHT)


@subroutine()
def pack_rows(first, end):
    """First and end row of a tile in one number, which saves memory."""
    return first * ROWS + end


@kernel()
def unpack_rows(rows):
    """First and end row of a tile, from `pack_rows`; unsigned, so that numba checks no signs."""
    return np.uint64(rows) // np.uint64(ROWS), np.uint64(rows) % np.uint64(ROWS)


@subroutine(fast=False)
def _whole(number, least, most):
    """A number rounded down and held between two whole ones; the lower one for what is no number.

    Held before it is rounded: no integer holds what may come in.
    """
    if not number > least:
        return least
    return floor(number) if number < most else most


@subroutine()
def _span(low, high, tile, least, end):
    """First and end of those tiles from `least` on that the pixel range [low, high] touches.

    The first one is never greater than the end.
    """
    first = _whole(low / tile, least, end)
    return first, _whole(high / tile, first - 1, end - 1) + 1


@subroutine()
def _columns(splat, left, right):
    """First and end column of tiles of a splat's box in the band from `left` to `right`."""
    reach = splat[6] + SLACK
    return _span(splat[0] - reach, splat[0] + reach, TILE_WIDTH, left, right)


@subroutine()
def _rows(splat, down):
    """First and end row of tiles of a splat's box."""
    reach = splat[7] + SLACK
    return _span(splat[1] - reach, splat[1] + reach, TILE_HEIGHT, 0, down)


@subroutine()
def _most_pairs(splat, left, right, down):
    """How many pairs a splat has at most in a band: the tiles of its box."""
    first, end = _columns(splat, left, right)
    top, bottom = _rows(splat, down)
    return (end - first) * (bottom - top)


@kernel()
def _pack(means, conics, alphas, extents, splats):
    """Copies what binning reads of each splat side by side in memory.

    `splats` (N, 8) gets mean (2), conic (3), the exponent at which the splat ends (negative where
    it is not drawn), extents (2).
    """
    for i in range(splats.shape[0]):
        splat = splats[i]
        splat[0], splat[1] = means[i, 0], means[i, 1]
        splat[2], splat[3], splat[4] = conics[i, 0], conics[i, 1], conics[i, 2]
        splat[5] = log(alphas[i] * np.float32(1 / MIN_ALPHA)) if alphas[i] > 0 else -1.0
        splat[6], splat[7] = extents[i, 0], extents[i, 1]


@kernel(parallel=True)
def _sort(order, splats, ordered):
    """Copies packed splats front to back, in a loop without branches that wait for memory."""
    for part in numba.prange(PARTS):
        count = order.size
        for k in range(part * count // PARTS, (part + 1) * count // PARTS):
            for j in range(8):
                ordered[k, j] = splats[order[k], j]


@kernel(parallel=True)
def _rooms(parts, ordered, left, right, down):
    """Where each part of the sorted splats begins to write its pairs in a band (parts + 1,)."""
    rooms, count = np.zeros(parts + 1, np.int64), ordered.shape[0]
    for part in numba.prange(parts):
        room = 0
        for k in range(part * count // parts, (part + 1) * count // parts):
            splat = ordered[k]
            room += _most_pairs(splat, left, right, down) if splat[5] >= 0 else 0
        rooms[part + 1] = room
    return rooms.cumsum()


@subroutine()
def _reach(tip, discriminant, room, b, low, high):
    """Range of 2q·v in the ellipse p·u² + b·u·v + q·v² ≤ cut, given that u lies in [low, high].

    Args:
        tip: The u at which v is greatest.
        discriminant: b² − 4pq.
        room: 4q·cut.
        b: As in the formula.
        low: Least u.
        high: Greatest u.

    Returns:
        Least and greatest 2q·v; least > greatest where nothing is left.
    """
    top, bottom = min(max(tip, low), high), min(max(-tip, low), high)
    under_top = discriminant * top * top + room
    under_bottom = discriminant * bottom * bottom + room
    if under_top < 0 or under_bottom < 0:
        return 1.0, -1.0
    return -b * bottom - sqrt(under_bottom), -b * top + sqrt(under_top)


@subroutine()
def _list(splat, number, left, right, down, pair, counts, pairs):
    """Lists the tiles of a splat and the rows it touches there, from pair `pair` on.

    What lies outside of the box is left out, so that the pairs fit into the room for them: the
    ellipse of a splat far off the picture is larger, where the projection limited the box, or where
    rounding errors count.

    Returns:
        The number behind the last pair.
    """
    x, y, p, b, q = splat[0] - 0.5, splat[1] - 0.5, 0.5 * splat[2], 1.0 * splat[3], 0.5 * splat[4]
    tip, scale = -0.5 * b / p * splat[7], 0.5 / q
    discriminant, room = b * b - 4 * p * q, 4 * q * splat[5]
    first_column, end_column = _columns(splat, left, right)
    upper, lower = _rows(splat, down)
    highest, lowest = upper * TILE_HEIGHT, lower * TILE_HEIGHT
    for column in range(first_column, end_column):
        low = column * TILE_WIDTH - x - SLACK
        high = low + TILE_WIDTH - 1 + 2 * SLACK
        top, bottom = _reach(tip, discriminant, room, b, low, high)
        first = _whole(y + scale * top - SLACK, highest - 1, lowest) + 1
        end = _whole(y + scale * bottom + SLACK, highest - 1, lowest - 1) + 1
        if first < end:
            for row in range(first // TILE_HEIGHT, (end - 1) // TILE_HEIGHT + 1):
                above = row * TILE_HEIGHT
                tile = row * (right - left) + column - left
                counts[tile] += 1
                pairs[pair, 0], pairs[pair, 1] = tile, number
                pairs[pair, 2] = pack_rows(max(first - above, 0), min(end - above, TILE_HEIGHT))
                pair += 1
    return pair


@kernel(parallel=True)
def _list_all(rooms, order, ordered, left, right, down, starts, ends, counts, pairs):
    """Lists the tiles of all splats, front to back, each part of the splats by one thread.

    `counts` (parts, tiles) gets the number of pairs in each tile, `pairs` (P, 3) tile, splat, rows.

    Returns:
        Where each part's pairs end (parts,).
    """
    parts, count = rooms.size - 1, order.size
    behind = np.empty(parts, np.int64)
    for part in numba.prange(parts):
        pair = rooms[part]
        for k in range(part * count // parts, (part + 1) * count // parts):
            starts[k] = pair
            if ordered[k, 5] >= 0:
                splat, own = ordered[k], counts[part]
                pair = _list(splat, order[k], left, right, down, pair, own, pairs)
            ends[k] = pair
        behind[part] = pair
    return behind


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
def _first_entries(counts, first_entry):
    """Finds where a tile's entries begin, and in place of `counts` where those of each part do."""
    total = 0
    for tile in range(counts.shape[1]):
        first_entry[tile] = total
        for part in range(counts.shape[0]):
            counts[part, tile], total = total, total + counts[part, tile]
    first_entry[counts.shape[1]] = total


@kernel(parallel=True)
def _fill(rooms, behind, pairs, following, entries):
    """Sorts pairs, which lie front to back, into tiles; `following` is where the next ones go."""
    for part in numba.prange(behind.size):
        for pair in range(rooms[part], behind[part]):
            tile = pairs[pair, 0]
            entry = following[part, tile]
            following[part, tile] += 1
            entries[entry, 0], entries[entry, 1] = pairs[pair, 1], pairs[pair, 2]
            entries[entry, 2] = pair


def _ends(splats: np.ndarray, left: int, right: int, down: int) -> list[int]:
    """Columns at which bands end that have no more than `MOST_PAIRS`, unless they are one block."""
    if right - left <= BLOCK or _rooms(PARTS, splats, left, right, down)[-1] <= MOST_PAIRS:
        return [right]
    middle = left + (right - left) // (2 * BLOCK) * BLOCK
    return _ends(splats, left, middle, down) + _ends(splats, middle, right, down)


def _band(order: np.ndarray, splats: np.ndarray, left: int, right: int, down: int) -> Band:
    """The tiles of the columns from `left` to `right`; `splats` are packed, front to back."""
    rooms, across = _rooms(PARTS, splats, left, right, down), right - left
    pairs = np.empty((rooms[-1], 3), np.int32)
    starts, ends = np.empty(len(order), np.int32), np.empty(len(order), np.int32)
    counts = np.zeros((PARTS, across * down), np.int32)
    behind = _list_all(rooms, order, splats, left, right, down, starts, ends, counts, pairs)
    first_entry = np.empty(across * down + 1, np.int32)
    _first_entries(counts, first_entry)
    entries = np.empty((first_entry[-1], 3), np.int32)
    _fill(rooms, behind, pairs, counts, entries)
    return Band(left, across, starts, ends, len(pairs), first_entry, entries)


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
    across, down = tiles_across(width), tiles_down(height)
    order, count = _order(depths), len(means2d)
    splats, ordered = np.empty((count, 8), np.float32), np.empty((count, 8), np.float32)
    _pack(means2d, conics, alphas, extents, splats)
    _sort(order, splats, ordered)
    ends = _ends(ordered, 0, across, down)
    first = _band(order, ordered, 0, ends[0], down)
    return Tiles(width, height, order, ordered, [0, *ends], first)
