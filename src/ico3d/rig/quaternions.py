"""Rotations as numpy arrays of quaternions wxyz (..., 4), of length 1 unless stated otherwise."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def normalized(quats: Array) -> Array:
    """(..., 4) quaternions scaled to length 1; zero quaternions become the identity."""
    length = np.linalg.norm(quats, axis=-1, keepdims=True)  # (..., 1)
    return np.where(length > 1e-12, quats / np.maximum(length, 1e-12), IDENTITY)


def multiply(a: Array, b: Array) -> Array:
    """Hamilton product a·b, (..., 4): first rotates by b, then by a."""
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    w = aw * bw - ax * bx - ay * by - az * bz
    found = np.empty((*w.shape, 4), w.dtype)  # (..., 4); np.stack takes as long as the products
    found[..., 0] = w
    found[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    found[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    found[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return found


def conjugate(quats: Array) -> Array:
    """(..., 4) inverse rotations."""
    return quats * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(quats: Array, vectors: Array) -> Array:
    """(..., 3) vectors rotated by quaternions (..., 4); both are broadcast."""
    axis, w = quats[..., 1:], quats[..., :1]  # (..., 3), (..., 1)
    twice = 2 * _cross(axis, vectors)
    return vectors + w * twice + _cross(axis, twice)


def _cross(a: Array, b: Array) -> Array:
    """(..., 3) cross product; np.cross takes several times as long where there are few."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    x = ay * bz - az * by
    found = np.empty((*x.shape, 3), x.dtype)  # (..., 3)
    found[..., 0] = x
    found[..., 1] = az * bx - ax * bz
    found[..., 2] = ax * by - ay * bx
    return found


def to_matrix(quats: Array) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(quats, -1, 0)
    rows = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    return np.stack(rows, -1).reshape(*quats.shape[:-1], 3, 3)  # (..., 3, 3)


def from_matrix(matrices: Array) -> Array:
    """Quaternions (..., 4) with w ≥ 0 of rotation matrices (..., 3, 3).

    Each quaternion is the eigenvector of the largest eigenvalue of a symmetric 4×4 matrix
    (Bar-Itzhack, 2000), which needs no case distinctions.
    """
    m = matrices
    trace = np.trace(m, axis1=-2, axis2=-1)  # (...)
    skew = np.stack(
        [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], -1
    )  # (..., 3)
    symmetric = np.zeros((*m.shape[:-2], 4, 4))  # (..., 4, 4)
    symmetric[..., 0, 0] = trace
    symmetric[..., 0, 1:] = symmetric[..., 1:, 0] = skew
    symmetric[..., 1:, 1:] = m + np.swapaxes(m, -1, -2) - trace[..., None, None] * np.eye(3)
    found = np.linalg.eigh(symmetric).eigenvectors[..., -1]  # (..., 4)
    return np.where(found[..., :1] < 0, -found, found)


def from_rotvec(vectors: Array) -> Array:
    """Quaternions (..., 4) of rotation vectors (..., 3): axis times angle in radians."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)  # (..., 1)
    return np.concatenate([np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) / 2 * vectors], -1)


def to_rotvec(quats: Array) -> Array:
    """Rotation vectors (..., 3) of quaternions (..., 4): axis times angle, at most π radians."""
    quats = np.where(quats[..., :1] < 0, -quats, quats)
    sine = np.linalg.norm(quats[..., 1:], axis=-1, keepdims=True)  # (..., 1)
    angle = 2 * np.arctan2(sine, quats[..., :1])  # (..., 1)
    factor = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)
    return factor * quats[..., 1:]


def slerp(a: Array, b: Array, part: Array | float) -> Array:
    """(..., 4) interpolation on the shorter arc from a (part 0) to b (part 1).

    `part` (...) is broadcast against a and b without their last axis.
    """
    vector = to_rotvec(multiply(conjugate(a), b))  # (..., 3)
    return multiply(a, from_rotvec(vector * np.asarray(part)[..., None]))


def continuous(quats: Array) -> Array:
    """(F, ..., 4) the same rotations, with signs that do not jump between successive rows."""
    dots = (quats[1:] * quats[:-1]).sum(-1)  # (F - 1, ...)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([quats[:1], quats[1:] * signs[..., None]])
