"""Rotations between directions, about axes, and parts of rotations; arrays as in `quaternions`."""

import numpy as np

from ico3d.rig.quaternions import Array, from_rotvec, multiply, normalized, rotate, to_rotvec


def unit(vectors: Array) -> Array:
    """(..., 3) vectors scaled to length 1; zero vectors stay zero."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def dot(a: Array, b: Array) -> Array:
    """(...) inner products of vectors (..., 3)."""
    return (a * b).sum(-1)


def across(vectors: Array, axis: Array) -> Array:
    """(..., 3) components of vectors (..., 3) orthogonal to a unit axis, scaled to length 1."""
    return unit(vectors - dot(vectors, axis)[..., None] * axis)


def about(axis: Array, angle: Array | float) -> Array:
    """(..., 4) rotations about unit axes (..., 3) by angles (...) in radians."""
    return from_rotvec(np.asarray(axis) * np.asarray(angle)[..., None])


def arc(start: Array, end: Array) -> Array:
    """(..., 4) shortest rotation from `start` to `end`, unit vectors (..., 3), not opposite."""
    start, end = np.broadcast_arrays(start, end)
    real = 1 + dot(start, end)[..., None]
    return normalized(np.concatenate([real, np.cross(start, end)], -1))


def angle_about(axis: Array, start: Array, end: Array) -> Array:
    """(...) angle in radians about a unit axis from `start` to `end`, both orthogonal to it."""
    return np.arctan2(dot(np.cross(start, end), axis), dot(start, end))


def aligned(start: tuple[Array, Array], end: tuple[Array, Array]) -> Array:
    """(..., 4) rotation that takes a pair of orthogonal directions to another pair.

    Args:
        start: Two unit vectors (..., 3), orthogonal to each other.
        end: The two unit vectors (..., 3) that they are taken to.
    """
    swing = arc(start[0], end[0])
    angle = angle_about(end[0], rotate(swing, start[1]), end[1])
    return multiply(about(end[0], angle), swing)


def twist_angle(quats: Array, axis: Array) -> Array:
    """(...) twist of rotations about a unit axis (3,), in radians from −π to π.

    A rotation is a twist about the axis, followed by a swing of the axis.
    """
    along = dot(quats[..., 1:], axis)
    angle = 2 * np.arctan2(along, quats[..., 0])
    return angle - 2 * np.pi * np.round(angle / (2 * np.pi))


def power(quats: Array, part: Array | float) -> Array:
    """(..., 4) rotations about the same axes by a share (...) of their angles."""
    return from_rotvec(to_rotvec(quats) * np.asarray(part)[..., None])


def mirrored(quats: Array) -> Array:
    """(..., 4) rotations mirrored in the plane x = 0, which exchanges left and right."""
    return quats * np.array([1.0, 1.0, -1.0, -1.0])
