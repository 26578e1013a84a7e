"""Rotations as gestures need them: between directions, about bones, and parts of them."""

import numpy as np

from ico3d.rig.quaternions import Array, from_rotvec, multiply, normalized, rotate, to_rotvec


def unit(vectors: Array) -> Array:
    """(..., 3) of length 1; zeros stay zeros."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def dot(a: Array, b: Array) -> Array:
    """(...) of (..., 3)."""
    return (a * b).sum(-1)


def across(vectors: Array, axis: Array) -> Array:
    """(..., 3) unit vectors: what stands at right angles to a unit axis."""
    return unit(vectors - dot(vectors, axis)[..., None] * axis)


def about(axis: Array, angle: Array | float) -> Array:
    """(..., 4) about unit axes (..., 3) by radians (...)."""
    return from_rotvec(np.asarray(axis) * np.asarray(angle)[..., None])


def arc(start: Array, end: Array) -> Array:
    """(..., 4) the shortest rotation between unit vectors (..., 3) that are not opposite."""
    start, end = np.broadcast_arrays(start, end)
    real = 1 + dot(start, end)[..., None]
    return normalized(np.concatenate([real, np.cross(start, end)], -1))


def angle_about(axis: Array, start: Array, end: Array) -> Array:
    """(...) radians about a unit axis from one vector at right angles to it to another."""
    return np.arctan2(dot(np.cross(start, end), axis), dot(start, end))


def aligned(start: tuple[Array, Array], end: tuple[Array, Array]) -> Array:
    """(..., 4) that takes a direction to another, and what stands across it as well.

    Args:
        start: Unit vectors (..., 3), the second at right angles to the first.
        end: Where they go.
    """
    swing = arc(start[0], end[0])
    angle = angle_about(end[0], rotate(swing, start[1]), end[1])
    return multiply(about(end[0], angle), swing)


def twist_angle(quats: Array, axis: Array) -> Array:
    """(...) radians, −π to π, that rotations turn about a unit axis (3,) before they swing it."""
    along = dot(quats[..., 1:], axis)
    angle = 2 * np.arctan2(along, quats[..., 0])
    return angle - 2 * np.pi * np.round(angle / (2 * np.pi))


def power(quats: Array, part: Array | float) -> Array:
    """(..., 4) a part (...) of each rotation, on the shorter way."""
    return from_rotvec(to_rotvec(quats) * np.asarray(part)[..., None])


def mirrored(quats: Array) -> Array:
    """(..., 4) seen in the mirror that swaps left and right."""
    return quats * np.array([1.0, 1.0, -1.0, -1.0])
