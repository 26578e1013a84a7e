"""Checks the Gaussians of a background (`background.spz` or `.ply`) in a bundle.

Only browsers decode this file. Here the header must not claim more Gaussians than a bundle may
hold, and the file must be as large as the header claims; SPZ, which is compressed, must not be
impossibly small.
"""

import re
import struct
import zlib

from ico3d.bundle import limits
from ico3d.errors import BundleError

BACKGROUNDS = ("background.spz", "background.ply")
"""Possible names of the background; a bundle holds at most one of them."""
_SPZ_HEADER = struct.Struct("<4sIIBBBB")
_SPZ_VERSIONS, _MAX_DEGREE = (2, 3, 4), 3
_LEAST_SPZ_BYTES = 19
"""Unpacked bytes of a Gaussian without harmonics."""
_MAX_RATIO, _FREE_BYTES = 8, 1 << 18
"""As in `ico3d.splat.files`: largest ratio of unpacked to packed bytes; bytes always allowed."""
_MAX_PLY_HEADER = 1 << 16
_WIDTHS = {
    **dict.fromkeys(("char", "int8", "uchar", "uint8"), 1),
    **dict.fromkeys(("short", "int16", "ushort", "uint16"), 2),
    **dict.fromkeys(("int", "int32", "uint", "uint32", "float", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}


def check_background(data: bytes, name: str) -> None:
    """Checks the content of a file named as in `BACKGROUNDS`.

    Raises:
        BundleError: If the file is too large, or its header is malformed or claims more than the
            file holds.
    """
    if len(data) > limits.MAX_BACKGROUND_BYTES:
        raise BundleError(f"{name}: is larger than {limits.MAX_BACKGROUND_BYTES} bytes.")
    check = _check_spz if name.endswith(".spz") else _check_ply
    check(data, name)


def _check_spz(data: bytes, name: str) -> None:
    header = _spz_header(data, name)
    if len(header) < _SPZ_HEADER.size or header[:4] != b"NGSP":
        raise BundleError(f"{name}: is not an SPZ file.")
    _, version, count, degree, *_ = _SPZ_HEADER.unpack(header)
    if version not in _SPZ_VERSIONS or degree > _MAX_DEGREE:
        raise BundleError(f"{name}: is an SPZ file of an unknown kind.")
    _check_count(count, name)
    if count * _LEAST_SPZ_BYTES > _MAX_RATIO * len(data) + _FREE_BYTES:
        raise BundleError(f"{name}: cannot hold the {count} Gaussians that it promises.")


def _spz_header(data: bytes, name: str) -> bytes:
    """The first bytes: as they are in version 4, of a gzip stream in earlier ones."""
    if data[:4] == b"NGSP":
        return data[: _SPZ_HEADER.size]
    try:
        unpacker = zlib.decompressobj(zlib.MAX_WBITS | 16)
        return unpacker.decompress(data, _SPZ_HEADER.size)
    except zlib.error as error:
        raise BundleError(f"{name}: is not an SPZ file.") from error


def _check_ply(data: bytes, name: str) -> None:
    end = re.search(rb"\nend_header\r?\n", data[:_MAX_PLY_HEADER])
    if end is None or data[:3] != b"ply":
        raise BundleError(f"{name}: is not a PLY file.")
    lines = [line.split() for line in data[: end.start()].decode("ascii", "replace").splitlines()]
    if ["format", "binary_little_endian", "1.0"] not in lines:
        raise BundleError(f"{name}: must be of the format binary_little_endian 1.0.")
    counts, widths = _ply_tables(lines, name)
    _check_count(counts.get("vertex", 0), name)
    promised = end.end() + sum(count * widths[table] for table, count in counts.items())
    if promised != len(data):
        raise BundleError(f"{name}: has {len(data)} bytes, but its header promises {promised}.")


def _ply_tables(lines: list[list[str]], name: str) -> tuple[dict[str, int], dict[str, int]]:
    """Rows, and bytes of a row, of each table."""
    counts: dict[str, int] = {}
    widths: dict[str, int] = {}
    for words in lines:
        match words:
            case ["element", table, rows] if rows.isdecimal() and table not in counts:
                counts[table], widths[table] = int(rows), 0
            case ["property", kind, _] if counts and kind in _WIDTHS:
                widths[list(counts)[-1]] += _WIDTHS[kind]
            case [("element" | "property"), *_]:
                raise BundleError(f"{name}: its header declares what no file of Gaussians has.")
            case _:
                pass
    return counts, widths


def _check_count(count: int, name: str) -> None:
    if not 1 <= count <= limits.MAX_GAUSSIANS:
        raise BundleError(f"{name}: must hold 1 to {limits.MAX_GAUSSIANS} Gaussians, not {count}.")
