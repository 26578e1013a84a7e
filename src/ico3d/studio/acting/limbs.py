"""Arms and legs that reach where hands and feet are to be: two bones and a hinge."""

from dataclasses import dataclass

import numpy as np

from ico3d.studio.person.skeleton import Skeleton, about

REACH = 0.9995
"""Longest part of a limb's length that it stretches to: a hinge never locks."""


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@dataclass(frozen=True)
class Bend:
    """How the two bones of a limb lie.

    Attributes:
        upper: (F, 3) direction of the upper bone.
        lower: (F, 3) direction of the lower bone.
        hinge: (F, 3) axis between them, at right angles to both.
    """

    upper: np.ndarray
    lower: np.ndarray
    hinge: np.ndarray


def reach(start: np.ndarray, end: np.ndarray, lengths: tuple[float, float], pole: np.ndarray):
    """Two bones from `start` towards `end` (law of cosines), the hinge moved towards `pole`.

    Args:
        start: (F, 3).
        end: (F, 3); nearer than the bones are long, or they only point to it.
        lengths: Metres that the upper and the lower bone are long.
        pole: (F, 3) direction in which elbow or knee points.
    """
    first, second = lengths
    along = end - start
    distance = np.linalg.norm(along, axis=-1, keepdims=True)  # (F, 1)
    along = along / distance
    distance = np.clip(distance, abs(first - second) + 1e-3, REACH * (first + second))
    sideways = unit(pole - (pole * along).sum(-1, keepdims=True) * along)
    cosine = (first**2 + distance**2 - second**2) / (2 * first * distance)
    joint = first * (cosine * along + np.sqrt(1 - cosine**2) * sideways)
    return Bend(unit(joint), unit(distance * along - joint), np.cross(sideways, along))


@dataclass(frozen=True)
class Limb:
    """An arm or a leg at rest.

    Attributes:
        upper: Joint at which it begins.
        lower: Elbow or knee.
        end: Wrist or ankle.
        lengths: Of upper and lower bone, metres.
        rest: How the bones lie at rest, with (3,) vectors.
    """

    upper: int
    lower: int
    end: int
    lengths: tuple[float, float]
    rest: Bend

    @staticmethod
    def of(skeleton: Skeleton, upper: str, lower: str, end: str) -> "Limb":
        """The limb between three joints."""
        first, second, last = (skeleton.index(name) for name in (upper, lower, end))
        a, b, c = skeleton.at[[first, second, last]]
        lengths = (float(np.linalg.norm(b - a)), float(np.linalg.norm(c - b)))
        one, two = unit(b - a), unit(c - b)
        return Limb(first, second, last, lengths, Bend(one, two, unit(np.cross(one, two))))

    def rotations(self, bend: Bend) -> tuple[np.ndarray, np.ndarray]:
        """(F, 3, 3) of the upper and of the lower bone, from rest, in canonical axes."""
        pairs = ((bend.upper, self.rest.upper), (bend.lower, self.rest.lower))
        first, second = (
            _basis(now, bend.hinge) @ np.swapaxes(_basis(rest, self.rest.hinge), -1, -2)
            for now, rest in pairs
        )
        return first, second


def _basis(direction: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """(..., 3, 3) orthonormal columns: bone, hinge, and what is at right angles to both."""
    return np.stack([direction, hinge, np.cross(direction, hinge)], -1)


def split_twist(rotation: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Splits rotations into a swing and the twist about a bone that comes before it.

    Args:
        rotation: (F, 3, 3).
        axis: (3,) the bone's direction at rest.

    Returns:
        swing (F, 3, 3), the shortest rotation that takes the bone where it goes, and twist (F,) in
        radians about the axis: rotation = swing · about(axis, twist).
    """
    there = rotation @ axis  # (F, 3)
    cross = np.cross(axis, there)
    length = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(length, there @ axis)
    swing = about(cross / np.maximum(length, 1e-9)[:, None], angle)
    rest = np.swapaxes(swing, -1, -2) @ rotation  # (F, 3, 3) about the axis only
    sine = np.einsum("a,fa->f", axis, _skew_part(rest))
    return swing, np.arctan2(sine, (np.trace(rest, axis1=-2, axis2=-1) - 1) / 2)


def _skew_part(rotation: np.ndarray) -> np.ndarray:
    """(F, 3) sine of the angle times the axis."""
    return 0.5 * np.stack(
        [
            rotation[:, 2, 1] - rotation[:, 1, 2],
            rotation[:, 0, 2] - rotation[:, 2, 0],
            rotation[:, 1, 0] - rotation[:, 0, 1],
        ],
        -1,
    )
