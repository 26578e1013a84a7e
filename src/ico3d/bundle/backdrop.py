"""Checks the Gaussians of a background (`background.spz` or `.ply`) in a bundle.

Only browsers decode this file. Here the header must not claim more Gaussians than a bundle may
hold, and the file must be as large as the header claims; SPZ, which is compressed, is unpacked to
its end for that, a piece at a time.
"""

import re

from ico3d.bundle import limits
from ico3d.common.spz.container import check, read_header
from ico3d.errors import BundleError, GaussianFileError

BACKGROUNDS = ("background.spz", "background.ply")
"""Possible names of the background; a bundle holds at most one of them."""
_MAX_PLY_HEADER = 1 << 16
_COUNT = re.compile("[0-9]{1,30}")
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
    of_kind = _check_spz if name.endswith(".spz") else _check_ply
    of_kind(data, name)


def _check_spz(data: bytes, name: str) -> None:
    try:
        _check_count(read_header(data).count, name)
        check(data)
    except GaussianFileError as error:
        raise BundleError(f"{name}: {error}.") from error


def _check_ply(data: bytes, name: str) -> None:
    end = re.search(rb"\nend_header\r?\n", data[:_MAX_PLY_HEADER])
    if end is None or data[:3] != b"ply":
        raise BundleError(f"{name}: is not a PLY file.")
    lines = [line.split() for line in data[: end.start()].decode("ascii", "replace").splitlines()]
    if ["format", "binary_little_endian", "1.0"] not in lines:
        raise BundleError(f"{name}: must be of the format binary_little_endian 1.0.")
    counts, widths = _ply_tables(lines, name)
    if any(count and not widths[table] for table, count in counts.items()):
        raise BundleError(f"{name}: its header promises rows without columns.")
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
            case ["element", table, rows] if _COUNT.fullmatch(rows) and table not in counts:
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
