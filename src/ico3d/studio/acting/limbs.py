"""Inverse kinematics of arms and legs: two bones and a hinge that reach for a goal."""

from dataclasses import dataclass

import numpy as np

from ico3d.studio.person.skeleton import Skeleton, about

REACH = 0.9995
"""Largest share of a limb's length that is used, so that the hinge is never fully straight."""


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3), scaled to length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@dataclass(frozen=True)
class Bend:
    """Directions of the two bones of a limb.

    Attributes:
        upper: (F, 3) unit direction of the upper bone.
        lower: (F, 3) unit direction of the lower bone.
        hinge: (F, 3) unit axis of the hinge, perpendicular to both bones.
    """

    upper: np.ndarray
    lower: np.ndarray
    hinge: np.ndarray


def reach(start: np.ndarray, end: np.ndarray, lengths: tuple[float, float], pole: np.ndarray):
    """Places two bones from `start` towards `end` (law of cosines), bent towards `pole`.

    Args:
        start: (F, 3) start of the upper bone, metres.
        end: (F, 3) goal of the lower bone, metres; a goal out of reach is only pointed at.
        lengths: Lengths of the upper and the lower bone, metres.
        pole: (F, 3) direction in which elbow or knee points.

    Returns:
        The directions of the bones.
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
        upper: Index of the joint at which the limb begins.
        lower: Index of elbow or knee.
        end: Index of wrist or ankle.
        lengths: Lengths of the upper and the lower bone, metres.
        rest: Directions of the bones at rest, as (3,) vectors.
    """

    upper: int
    lower: int
    end: int
    lengths: tuple[float, float]
    rest: Bend

    @staticmethod
    def of(skeleton: Skeleton, upper: str, lower: str, end: str) -> "Limb":
        """The limb between three named joints."""
        first, second, last = (skeleton.index(name) for name in (upper, lower, end))
        a, b, c = skeleton.at[[first, second, last]]
        lengths = (float(np.linalg.norm(b - a)), float(np.linalg.norm(c - b)))
        one, two = unit(b - a), unit(c - b)
        return Limb(first, second, last, lengths, Bend(one, two, unit(np.cross(one, two))))

    def rotations(self, bend: Bend) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (F, 3, 3) from rest, in canonical axes: of the upper and of the lower bone."""
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
    """Splits rotations into a twist about a bone, which is applied first, and a swing.

    Args:
        rotation: (F, 3, 3) rotations.
        axis: (3,) unit direction of the bone at rest.

    Returns:
        swing (F, 3, 3), the shortest rotation that moves the bone to its new direction, and twist
        (F,), radians about the axis: rotation = swing · about(axis, twist).
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
