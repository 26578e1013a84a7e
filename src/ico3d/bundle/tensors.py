"""Safetensors with exact expectations of each tensor's dtype, shape and finiteness."""

import struct
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from safetensors.numpy import save

from ico3d.common.typed import parse_json
from ico3d.errors import BundleError

_DTYPES = {
    "F32": np.dtype("<f4"),
    "F16": np.dtype("<f2"),
    "I16": np.dtype("<i2"),
    "I8": np.dtype("i1"),
    "U8": np.dtype("u1"),
}
_MAX_HEADER_BYTES = 1 << 16
QUAT_UNIT = 32767
"""The int16 that stands for 1 in quaternions."""

Spec = Mapping[str, tuple[str, tuple[int, ...]]]
"""For each tensor that a file must hold, by name: safetensors dtype and shape."""
Axes = Mapping[str, int]
"""For each tensor with one row per Gaussian, by name: the axis of these rows."""


def encode_tensors(tensors: Mapping[str, np.ndarray], spec: Spec, name: str) -> bytes:
    """Serialises tensors according to `spec`; equal tensors give equal bytes.

    Raises:
        BundleError: If a tensor has another dtype or shape, or is not finite.
    """
    for key, (dtype, shape) in spec.items():
        array = tensors[key]
        if array.dtype != _DTYPES[dtype] or array.shape != shape:
            raise BundleError(
                f"{name}: '{key}' must be {dtype} {shape}, not {array.dtype} {array.shape}."
            )
        _check_finite(array, key, name)
    return save({key: np.ascontiguousarray(tensors[key]) for key in spec})


def decode_tensors(data: bytes, spec: Spec, name: str) -> dict[str, np.ndarray]:
    """Decodes tensors as read-only views of `data`.

    Args:
        data: Content of a safetensors file.
        spec: The tensors that the file must hold, no more and no less.
        name: Name of the file, for errors.

    Raises:
        BundleError: If the header is malformed, or dtypes, shapes or values do not comply.
    """
    header, start = _header(data, name)
    if set(header) != set(spec):
        odd = sorted(set(header) ^ set(spec))[0]
        problem = "lacks" if odd in spec else "has the unknown"
        raise BundleError(f"{name}: {problem} tensor {odd[:40]!r}.")
    spans: list[tuple[int, int]] = []
    tensors: dict[str, np.ndarray] = {}
    for key, (dtype, shape) in spec.items():
        span = _check_entry(header[key], dtype, shape, f"{name}: '{key}'")
        if start + span[1] > len(data):
            raise BundleError(f"{name}: '{key}' lies outside the file.")
        spans.append(span)
        flat = np.frombuffer(data, _DTYPES[dtype], int(np.prod(shape)), start + span[0])
        tensors[key] = flat.reshape(shape)
        _check_finite(tensors[key], key, name)
    _check_cover(spans, len(data) - start, name)
    return tensors


def split_tensors(
    tensors: Mapping[str, np.ndarray], spec: Spec, axes: Axes, first: int, names: tuple[str, str]
) -> tuple[bytes, bytes]:
    """Serialises tensors as two files, of which the first can be used alone.

    Args:
        tensors: The tensors.
        spec: What they are together.
        axes: The tensors with one row per Gaussian.
        first: Number of Gaussians in the first file.
        names: Names of the two files, for errors.

    Returns:
        The first Gaussians with everything that all share, and the other Gaussians.

    Raises:
        BundleError: If a tensor does not comply with `spec`.
    """
    cut = {key: np.split(tensors[key], [first], axis) for key, axis in axes.items()}
    head = dict(tensors) | {key: parts[0] for key, parts in cut.items()}
    rest = {key: parts[1] for key, parts in cut.items()}
    count = tensors[next(iter(axes))].shape[axes[next(iter(axes))]]
    own, other = _rows(spec, axes, first), _rows(spec, axes, count - first)
    return (
        encode_tensors(head, own, names[0]),
        encode_tensors(rest, {key: other[key] for key in axes}, names[1]),
    )


def join_tensors(
    files: tuple[bytes, bytes], spec: Spec, axes: Axes, rest: int, names: tuple[str, str]
) -> dict[str, np.ndarray]:
    """Decodes what `split_tensors` has written.

    Args:
        files: Contents of the two files.
        spec: What the tensors are together.
        axes: The tensors with one row per Gaussian.
        rest: Number of Gaussians in the second file.
        names: Names of the two files, for errors.

    Raises:
        BundleError: If a file is malformed or does not comply.
    """
    key, axis = next(iter(axes.items()))
    own = _rows(spec, axes, spec[key][1][axis] - rest)
    other = _rows(spec, axes, rest)
    tensors = decode_tensors(files[0], own, names[0])
    more = decode_tensors(files[1], {key: other[key] for key in axes}, names[1])
    joined = {key: np.concatenate([tensors[key], more[key]], axis) for key, axis in axes.items()}
    return tensors | joined


def _rows(spec: Spec, axes: Axes, count: int) -> Spec:
    """The same tensors with `count` Gaussians."""
    changed = dict(spec)
    for key, axis in axes.items():
        dtype, shape = spec[key]
        changed[key] = dtype, (*shape[:axis], count, *shape[axis + 1 :])
    return changed


def _header(data: bytes, name: str) -> tuple[dict[str, Any], int]:
    """The header without its free-text metadata, and where the values start."""
    if len(data) < 8:
        raise BundleError(f"{name}: is too short to hold tensors.")
    (length,) = struct.unpack_from("<Q", data)
    if length > min(_MAX_HEADER_BYTES, len(data) - 8):
        raise BundleError(f"{name}: has a header of impossible length.")
    header = parse_json(data[8 : 8 + length], name, BundleError)
    if not isinstance(header, dict):
        raise BundleError(f"{name}: its header is not an object.")
    entries = cast(dict[str, Any], header)
    entries.pop("__metadata__", None)
    return entries, 8 + length


def _check_entry(entry: Any, dtype: str, shape: tuple[int, ...], where: str) -> tuple[int, int]:
    """Compares one header entry with the expectation; returns its byte span."""
    given = cast(dict[str, Any], entry) if isinstance(entry, dict) else {}
    if set(given) != {"dtype", "shape", "data_offsets"}:
        raise BundleError(f"{where} has a malformed header entry.")
    if given["dtype"] != dtype or given["shape"] != list(shape):
        found = f"{given['dtype']} {given['shape']}"[:60]
        raise BundleError(f"{where} must be {dtype} {list(shape)}, not {found}.")
    offsets = given["data_offsets"]
    span = cast(list[Any], offsets) if isinstance(offsets, list) else []
    if len(span) != 2 or not all(type(x) is int for x in span):
        raise BundleError(f"{where} has malformed offsets.")
    size = int(np.prod(shape)) * _DTYPES[dtype].itemsize
    if span[0] < 0 or span[1] - span[0] != size:
        raise BundleError(f"{where} must take {size} bytes.")
    return span[0], span[1]


def _check_cover(spans: list[tuple[int, int]], size: int, name: str) -> None:
    """Tensors must fill the file without gap or overlap (the safetensors rule)."""
    position = 0
    for begin, end in sorted(spans):
        if begin != position:
            raise BundleError(f"{name}: its tensors overlap or leave a gap.")
        position = end
    if position != size:
        raise BundleError(f"{name}: has bytes that belong to no tensor.")


def _check_finite(array: np.ndarray, key: str, name: str) -> None:
    if not np.isfinite(array).all():
        raise BundleError(f"{name}: '{key}' holds a value that is not finite.")
