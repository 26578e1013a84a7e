"""Looks at packed data of SMC files before HDF5 unpacks them.

HDF5 unpacks a piece to the end of what was packed, however short the data set says that it is, and
filters may stand behind each other: 48 kB can become gigabytes.
"""

import math
import zlib
from typing import Any

DEFLATE, SHUFFLE, FLETCHER32 = 1, 2, 3
"""Numbers of HDF5's filters: packing, the order of bytes before it, and a checksum."""
KNOWN = ((), (SHUFFLE,), (DEFLATE,), (SHUFFLE, DEFLATE))
"""Filters that may stand behind each other, beside checksums."""
CHECKSUM = 4
"""Bytes of a checksum, which is packed along where it stands before the packing."""
MOST_TIMES = 32
"""How many times as many bytes as are stored may come of them; pictures pack hardly at all."""
SMALL = 4 * 2**20
"""Bytes that may come of any number of stored ones, as of tables of zeros."""
MOST_PIECES = 100_000


def is_bounded(node: Any, file_size: int) -> bool:
    """Whether a data set may be read: no more comes of it than it says, nor much from little.

    Args:
        node: The data set.
        file_size: Size of its file in bytes.
    """
    piece = math.prod(node.chunks or (0,)) * node.dtype.itemsize
    stored = min(node.id.get_storage_size(), file_size)
    if max(node.nbytes, piece) > max(SMALL, MOST_TIMES * stored):
        return False
    filters = _filters(node)
    if not _known(filters):
        return False
    return DEFLATE not in filters or _all_bounded(node, filters, piece + CHECKSUM)


def first_bytes(node: Any, count: int) -> bytes | None:
    """The first bytes of a data set of bytes, of which no more is unpacked; None if damaged.

    Args:
        node: The data set, (N,) uint8.
        count: Highest number of bytes.
    """
    filters = _filters(node)
    if not _known(filters):
        return None
    if DEFLATE not in filters:
        return node[:count].tobytes()
    if not node.size or node.id.get_chunk_info_by_coord((0,)).byte_offset is None:
        return b""
    mask, data = node.id.read_direct_chunk((0,))
    if _is_skipped(filters, mask):
        return data[:count]
    try:
        return zlib.decompressobj().decompress(data, count)
    except zlib.error:
        return None


def _all_bounded(node: Any, filters: tuple[int, ...], most: int) -> bool:
    """Whether no more than `most` bytes come of any packed piece of a data set."""
    pieces = list[Any]()

    def note(piece: Any) -> bool | None:
        pieces.append(piece)
        return len(pieces) > MOST_PIECES or None  # anything but None ends it

    node.id.chunk_iter(note)
    packed = (p.chunk_offset for p in pieces if not _is_skipped(filters, p.filter_mask))
    return len(pieces) <= MOST_PIECES and all(
        _ends(node.id.read_direct_chunk(where)[1], most) for where in packed
    )


def _ends(data: bytes, most: int) -> bool:
    """Whether packed bytes end within so many unpacked ones."""
    unpacking = zlib.decompressobj()
    try:
        return len(unpacking.decompress(data, most + 1)) <= most and unpacking.eof
    except zlib.error:
        return False


def _filters(node: Any) -> tuple[int, ...]:
    """The filters of a data set, in the order of packing."""
    plan = node.id.get_create_plist()
    return tuple(plan.get_filter(index)[0] for index in range(plan.get_nfilters()))


def _known(filters: tuple[int, ...]) -> bool:
    """Whether all filters are known, and packing comes last."""
    return tuple(f for f in filters if f != FLETCHER32) in KNOWN


def _is_skipped(filters: tuple[int, ...], mask: int) -> bool:
    """Whether a piece was stored without the packing."""
    return bool(mask >> filters.index(DEFLATE) & 1)
