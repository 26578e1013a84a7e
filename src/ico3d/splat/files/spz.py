"""Niantic's SPZ files: about a fifth of the size of PLY, with hardly visible errors.

The format defines its axes as x right, y up, z backward (RUB). Reading and writing convert, so that
`RawGaussians` always have the axes of PLY files. Quantisation follows Niantic's reference code
(MIT), but spherical harmonics keep all 8 bits.
"""

import gzip
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ico3d.common.spz.container import Header, unpack
from ico3d.errors import GaussianFileError
from ico3d.splat.files.raw import Floats, RawGaussians, half_turn_in_place, logits

VERSION = 3
FRACTIONAL_BITS = 12
"""Positions are rounded to 2⁻¹² m, as the reference code does, unless some lie too far away."""

_COLOR_SCALE = 0.15
_SMALL = np.float32(np.sqrt(0.5) / 511)
"""Step of a quaternion's three smaller components: 9 bits for up to √½."""


def read(data: bytes) -> RawGaussians:
    """Decodes the Gaussians of an SPZ file.

    Raises:
        GaussianFileError: If the file is damaged or unpacks to far more than its size.
        MissingExtraError: If the file is version 4 and the package zstandard is not installed.
    """
    header, sections = unpack(data)
    gaussians = RawGaussians(
        means=_unpack_positions(sections["positions"], header.fractional_bits),
        dc=_affine(sections["colors"], 1 / (255 * _COLOR_SCALE), -0.5 / _COLOR_SCALE),
        rest=_unpack_sh(sections.get("sh"), header.count),
        opacities=logits(sections["alphas"][:, 0] / 255),
        log_scales=_affine(sections["scales"], 1 / 16, -10),
        quats=_unpack_rotations(sections["rotations"], header.version),
    )
    half_turn_in_place(gaussians)
    return gaussians


def write(gaussians: RawGaussians, path: Path) -> None:
    """Writes an SPZ file of version 3.

    Raises:
        GaussianFileError: If a Gaussian lies farther away than the format allows (8,388,607 m).
    """
    turned = gaussians.half_turn()
    bits = _fractional_bits(turned.means)
    header = Header(VERSION, len(turned), turned.degree, bits)
    parts = [
        _pack_positions(turned.means, bits),
        _bytes(255 / (1 + np.exp(-np.clip(turned.opacities, -50, 50)))),
        _bytes(turned.dc * (_COLOR_SCALE * 255) + 127.5),
        _bytes((turned.log_scales + 10) * 16),
        _pack_rotations(turned.quats),
        _bytes(turned.rest * 128 + 128),
    ]
    packed = header.pack() + b"".join(part.tobytes() for part in parts)
    path.write_bytes(gzip.compress(packed, mtime=0))


def _affine(packed: NDArray[np.uint8], scale: float, offset: float) -> Floats:
    """Values that bytes stand for: scale · byte + offset."""
    values = packed.astype(np.float32)
    values *= scale
    values += offset
    return values


def _bytes(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Values rounded to the nearest byte."""
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


def _fractional_bits(means: Floats) -> int:
    """As many bits after the point as leave enough before it."""
    furthest = float(np.abs(means).max(initial=0))
    for bits in range(FRACTIONAL_BITS, -1, -1):
        if round(furthest * 2**bits) < 1 << 23:
            return bits
    raise GaussianFileError(
        f"a Gaussian lies {furthest:.3g} m from the origin, further than SPZ can say: "
        "write a PLY, or remove it"
    )


def _unpack_positions(packed: NDArray[np.uint8], bits: int) -> Floats:
    """Positions (N, 3) of 24-bit fixed-point numbers (N, 9)."""
    wide = np.zeros((len(packed), 3, 4), np.uint8)
    wide[..., 1:] = packed.reshape(-1, 3, 3)
    fixed = wide.view("<i4")[..., 0]  # (N, 3), 256 times too large, which keeps the sign
    return fixed.astype(np.float32) * np.float32(2.0 ** (-8 - bits))


def _pack_positions(means: Floats, bits: int) -> NDArray[np.uint8]:
    """24-bit fixed-point numbers (N, 3, 3 bytes) of positions (N, 3)."""
    fixed = np.round(means * np.float32(2**bits)).astype("<i4")
    return fixed[..., None].view(np.uint8)[..., :3]


def _unpack_rotations(packed: NDArray[np.uint8], version: int) -> Floats:
    """Unit quaternions wxyz (N, 4)."""
    if version == 2:
        vector = _affine(packed, 1 / 127.5, -1)  # (N, 3)
        real = np.sqrt(np.maximum(0, 1 - (vector * vector).sum(1, keepdims=True)))  # (N, 1)
        return np.concatenate([real, vector], 1, dtype=np.float32)
    words = np.ascontiguousarray(packed).view("<u4")[:, 0]  # (N,)
    largest = words >> 30
    quats = np.zeros((len(words), 4), np.float32)  # xyzw
    for axis in (3, 2, 1, 0):
        stored = largest != axis
        size = (words & 511).astype(np.float32) * _SMALL
        quats[:, axis] = np.where(stored, np.where(words & 512, -size, size), 0)
        words = np.where(stored, words >> 10, words)
    missing = np.sqrt(np.maximum(0, 1 - (quats * quats).sum(1)))
    np.put_along_axis(quats, largest.astype(np.intp)[:, None], missing[:, None], 1)
    return quats[:, [3, 0, 1, 2]]


def _pack_rotations(quats: Floats) -> NDArray[np.uint8]:
    """Words (N, 4 bytes) of quaternions wxyz (N, 4): which is largest, and the three others."""
    lengths = np.linalg.norm(quats.astype(np.float64), axis=1, keepdims=True)
    identity = np.array([1.0, 0, 0, 0])
    unit = np.where(lengths > 0, quats / np.maximum(lengths, np.finfo(float).tiny), identity)
    unit = unit[:, [1, 2, 3, 0]]  # xyzw
    largest = np.abs(unit).argmax(1)  # (N,)
    sign = np.where(np.take_along_axis(unit, largest[:, None], 1) < 0, -1, 1)
    unit = unit * sign  # the largest becomes positive: the same rotation
    words: NDArray[np.uint32] = largest.astype(np.uint32)
    for axis in range(4):
        size = np.minimum(np.round(np.abs(unit[:, axis]) / _SMALL), 511).astype(np.uint32)
        word = words << 10 | (unit[:, axis] < 0).astype(np.uint32) << 9 | size
        words = np.where(largest == axis, words, word)
    return words.astype("<u4")[:, None].view(np.uint8)


def _unpack_sh(packed: NDArray[np.uint8] | None, count: int) -> Floats:
    """Harmonics (N, K - 1, 3) above degree 0 of bytes (N, 3·(K - 1)), colour running fastest."""
    if packed is None:
        return np.empty((count, 0, 3), np.float32)
    return _affine(packed, 1 / 128, -1).reshape(count, packed.shape[1] // 3, 3)
