"""Compressed PLY of PlayCanvas and SuperSplat: 16 bytes per Gaussian, bounds per 256 Gaussians.

Layout and rounding follow PlayCanvas' splat-transform (MIT).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ico3d.errors import GaussianFileError
from ico3d.splat.files.ply import columns
from ico3d.splat.files.raw import Floats, RawGaussians, dc_of_colors, logits, rest_properties
from ico3d.splat.files.standard_ply import by_coefficient

CHUNK = 256
_BLOCK = 64 * CHUNK  # Gaussians unpacked at once, so that intermediate arrays stay small
PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
_AXES = ("x", "y", "z")
_BOUNDS = {"position": _AXES, "scale": tuple(f"scale_{a}" for a in _AXES), "color": ("r", "g", "b")}
_SH = np.concatenate([[-4.0], (np.arange(1, 255) + 0.5) / 32 - 4, [4.0]]).astype(np.float32)
"""The harmonic that each byte stands for."""


@dataclass(frozen=True)
class _Range:
    """Bounds (chunks, 3) between which a chunk's values lie."""

    low: Floats
    high: Floats

    def at(self, chunk: NDArray[Any], fraction: NDArray[Any]) -> NDArray[Any]:
        """Values (n, 3) at fractions (n, 3) of the way between the bounds of chunks (n,)."""
        return self.low[chunk] * (1 - fraction) + self.high[chunk] * fraction


def read(tables: dict[str, NDArray[Any]]) -> RawGaussians:
    """Decodes Gaussians from the tables `chunk`, `vertex` and (optional) `sh` of a compressed PLY.

    Raises:
        GaussianFileError: If tables or columns are missing or do not fit together.
    """
    _check(tables)
    ranges = {kind: _range(tables["chunk"], names) for kind, names in _BOUNDS.items()}
    packed = columns(tables["vertex"], PACKED, "u4")  # (N, 4)
    count = len(packed)
    result = RawGaussians(
        means=np.empty((count, 3), np.float32),
        dc=np.empty((count, 3), np.float32),
        rest=_rest(tables.get("sh"), count),
        opacities=np.empty(count, np.float32),
        log_scales=np.empty((count, 3), np.float32),
        quats=np.empty((count, 4), np.float32),
    )
    with np.errstate(all="ignore"):  # what is not finite is refused by the caller
        for start in range(0, count, _BLOCK):
            rows = slice(start, min(start + _BLOCK, count))
            _unpack(packed[rows], np.arange(rows.start, rows.stop) // CHUNK, ranges, result, rows)
    return result


def _check(tables: dict[str, NDArray[Any]]) -> None:
    """Refuses tables that are no compressed Gaussians."""
    if "chunk" not in tables:
        raise GaussianFileError("a compressed PLY without the element 'chunk'")
    count, chunks = len(tables["vertex"]), len(tables["chunk"])
    if chunks * CHUNK < count:
        raise GaussianFileError(f"{chunks} chunks of {CHUNK} are too few for {count} Gaussians")
    kinds = tables["vertex"].dtype.fields or {}
    for name in PACKED:
        if name not in kinds or kinds[name][0].newbyteorder("<") != np.dtype("<u4"):
            raise GaussianFileError(f"the property {name} is no 32-bit unsigned integer")
    if "sh" in tables and len(tables["sh"]) != count:
        raise GaussianFileError(f"{len(tables['sh'])} rows of harmonics for {count} Gaussians")


def _range(chunks: NDArray[Any], names: tuple[str, ...]) -> _Range:
    """Bounds of one kind; colours of old files have none and lie between 0 and 1."""
    present = chunks.dtype.names or ()
    low, high = ([f"{end}_{name}" for name in names] for end in ("min", "max"))
    if names == _BOUNDS["color"] and not set(low + high) & set(present):
        return _Range(*(np.full((len(chunks), 3), v, np.float32) for v in (0, 1)))
    for name in low + high:
        if name not in present:
            raise GaussianFileError(f"a compressed PLY whose chunks lack the property {name}")
    return _Range(columns(chunks, low), columns(chunks, high))


def _rest(table: NDArray[Any] | None, count: int) -> Floats:
    """Harmonics (N, K - 1, 3) above degree 0.

    Raises:
        GaussianFileError: If they are none of degree 1, 2 or 3 in bytes.
    """
    if table is None:
        return np.empty((count, 0, 3), np.float32)
    present = set(table.dtype.names or ())
    names = next((n for n in map(rest_properties, (1, 2, 3)) if set(n) == present), None)
    if names is None or any(table.dtype[name] != np.uint8 for name in names):
        raise GaussianFileError(
            "the element 'sh' is expected to hold f_rest_0 to 8, 23 or 44, uchar"
        )
    return by_coefficient(_SH[columns(table, names, "u1")])


def _unpack(
    packed: NDArray[Any],
    chunk: NDArray[Any],
    ranges: dict[str, _Range],
    result: RawGaussians,
    rows: slice,
) -> None:
    """Writes Gaussians of packed words (n, 4) in chunks (n,) into rows of the result."""
    position, rotation, scale, color = packed.T
    result.means[rows] = ranges["position"].at(
        chunk, _fractions(position, (21, 11, 0), (11, 10, 11))
    )
    result.log_scales[rows] = ranges["scale"].at(
        chunk, _fractions(scale, (21, 11, 0), (11, 10, 11))
    )
    rgba = _fractions(color, (24, 16, 8, 0), (8, 8, 8, 8))  # (n, 4)
    result.dc[rows] = dc_of_colors(ranges["color"].at(chunk, rgba[:, :3]))
    result.opacities[rows] = logits(rgba[:, 3])
    result.quats[rows] = _quats(rotation)


def _fractions(words: NDArray[Any], shifts: tuple[int, ...], bits: tuple[int, ...]) -> Floats:
    """Fields (n, len(bits)) of 32-bit words (n,) as fractions of their largest value."""
    masks = (1 << np.array(bits, np.uint32)) - 1
    parts = (words[:, None] >> np.array(shifts, np.uint32)) & masks
    return parts.astype(np.float32) / masks.astype(np.float32)


def _quats(words: NDArray[Any]) -> Floats:
    """Unit quaternions wxyz (n, 4) of words (n,): which is largest, and the three others."""
    small = (_fractions(words, (20, 10, 0), (10, 10, 10)) - 0.5) * np.float32(np.sqrt(2))  # (n, 3)
    largest = (words >> 30).astype(np.intp)  # (n,)
    order = np.argsort(np.arange(4) != largest[:, None], axis=1, kind="stable")  # largest, rest
    values = np.empty((len(words), 4), np.float32)
    values[:, 0] = np.sqrt(np.maximum(0, 1 - (small * small).sum(1)))
    values[:, 1:] = small
    quats = np.empty_like(values)
    np.put_along_axis(quats, order, values, 1)
    return quats
