"""Approximates a body by round limbs with which cloth collides."""

from dataclasses import dataclass, replace

import numpy as np

from ico3d.errors import SettingsError
from ico3d.studio.person.edges import sides
from ico3d.studio.person.skeleton import Skeleton
from ico3d.studio.person.subject import CARDS, Subject

THIGH = ("upperleg01", "upperleg02")
SHIN = ("lowerleg01", "lowerleg02")
ARM = ("clavicle", "shoulder", "upperarm", "lowerarm", "wrist", "metacarpal", "finger")
"""Beginnings of the names of the arm's joints in MakeHuman's default rig."""
WAIST = "spine04"
"""Joint whose height is that of the waist, where a skirt hangs."""
CUTS = 4
"""Number of cross sections taken of a limb."""
PLANES = 9
"""Number of cutting planes for a slice of the hips, so that no hem between them is missed."""
BULGE = 0.006
"""Metres by which hips are enlarged, because their skin partly follows a turning thigh."""
ENDS = (0.05, 0.95)
"""Positions of the first and the last cross section along the bone, as shares of its length."""
SEAT = 0.15
"""How far the hips reach below the hip joints, as a share of the thigh's length."""
ROUND = 0.3
"""Distance below the hip joint from which a thigh is round, as a share of the thigh's length."""


@dataclass(frozen=True)
class Limbs:
    """C straight segments whose radius changes linearly from one end to the other.

    Attributes:
        joints: (C,) int, index of the joint that carries each segment.
        ends: (C, 2, 3) ends of the segments, metres, canonical head space at rest.
        radii: (C, 2) radii at the two ends, metres.
    """

    joints: np.ndarray
    ends: np.ndarray
    radii: np.ndarray

    def posed(self, matrices: np.ndarray) -> np.ndarray:
        """(F, C, 2, 3) ends of the segments for joint transforms (F, J, 4, 4)."""
        carried = matrices[:, self.joints]  # (F, C, 4, 4)
        turned = np.einsum("fcab,ceb->fcea", carried[..., :3, :3], self.ends)
        return turned + carried[:, :, None, :3, 3]


@dataclass(frozen=True)
class Section:
    """A horizontal cut through a trunk, approximated by a stadium whose long side lies along X.

    All of the trunk's cut lies inside the stadium.

    Attributes:
        height: Height of the cut, metres, canonical head space at rest.
        middle: Z of the stadium's centre, metres.
        half_length: Half of the stadium's straight part, metres.
        radius: Radius of the stadium's round ends, metres.
    """

    height: float
    middle: float
    half_length: float
    radius: float

    def ends(self) -> np.ndarray:
        """(2, 3) centres of the stadium's round ends, left and right."""
        left = np.array([self.half_length, self.height, self.middle])
        return np.stack([left, left * (-1, 1, 1)])


def limbs_of(subject: Subject) -> Limbs:
    """Hips, thighs and shins of a whole person.

    Raises:
        SettingsError: If the mesh has no vertices where a limb should be.
    """
    bones = _bones(subject)
    found = [_hips(subject)]
    for side in "LR":
        found.append(_limb(subject, THIGH, f"upperleg01.{side}", f"lowerleg01.{side}", ROUND))
        found.append(_limb(subject, SHIN, f"lowerleg01.{side}", f"foot.{side}"))
    joints = [np.full(len(ends), bones.index(name)) for name, ends, _ in found]
    ends, radii = (np.concatenate(values) for values in list(zip(*found, strict=True))[1:])
    return Limbs(np.concatenate(joints), ends, radii)


def trunk_section(subject: Subject, height: float, around: float = 0.0) -> Section:
    """The horizontal cut through the trunk, without arms, at some height.

    Args:
        subject: A whole person at rest.
        height: Height in metres, canonical head space at rest.
        around: Metres up and down within which further cuts are made; the result is as wide as the
            widest and as deep as the deepest.

    Raises:
        SettingsError: If the mesh has nothing at that height.
    """
    bones = _bones(subject)
    trunk = bones.weights[:, _columns(bones, ARM)].sum(axis=1) < 0.5
    planes = height + around * np.linspace(-1, 1, PLANES if around else 1)
    cut = np.concatenate([_cut(subject, trunk, subject.vertices[:, 1] - y) for y in planes])
    wide, deep = np.abs(cut[:, 0]).max(), np.ptp(cut[:, 2])
    middle = 0.5 * float(cut[:, 2].max() + cut[:, 2].min())
    half_length = max(0.0, float(wide - deep / 2))
    beside = np.maximum(np.abs(cut[:, 0]) - half_length, 0)  # (P,)
    return Section(height, middle, half_length, float(np.hypot(beside, cut[:, 2] - middle).max()))


def waist_height(subject: Subject) -> float:
    """Height of the waist, metres, canonical head space at rest."""
    bones = _bones(subject)
    return float(bones.at[bones.index(WAIST), 1])


def _bones(subject: Subject) -> Skeleton:
    if subject.skeleton is None:
        raise SettingsError(f"{subject.name} is a bust: only a whole person wears such a garment.")
    return subject.skeleton


def _columns(bones: Skeleton, starts: tuple[str, ...], side: str = "") -> list[int]:
    """Numbers of the joints whose names begin and end like this."""
    return [i for i, n in enumerate(bones.names) if n.startswith(starts) and n.endswith(side)]


def _cut(subject: Subject, chosen: np.ndarray, above: np.ndarray) -> np.ndarray:
    """(P, 3) where edges between chosen vertices pass a plane that they are `above` (V,)."""
    faces = subject.faces[~np.isin(subject.materials, CARDS)]
    edges = sides(faces)
    edges = np.unique(edges[chosen[edges].all(axis=1)], axis=0)
    first, second = above[edges].T.astype(float)
    crossing = (first < 0) != (second < 0)
    if not crossing.any():
        raise SettingsError(f"{subject.name} cannot wear this: the mesh of the body has gaps.")
    first, second = first[crossing], second[crossing]
    part = (first / (first - second))[:, None]
    a, b = subject.vertices[edges[crossing]].astype(float).transpose(1, 0, 2)
    return a + part * (b - a)


def _limb(
    subject: Subject, group: tuple[str, ...], joint: str, tip: str, first: float = ENDS[0]
) -> tuple[str, np.ndarray, np.ndarray]:
    """Name of the joint, ends (C, 2, 3) and radii (C, 2) of an arm's or a leg's half."""
    bones = _bones(subject)
    start, end = bones.at[[bones.index(joint), bones.index(tip)]]
    weights = bones.weights[:, _columns(bones, group, joint[-2:])].sum(axis=1)
    along = (end - start) / ((end - start) @ (end - start))
    places = (subject.vertices - start) @ along  # (V,) from 0 at the joint to 1 at the tip
    centres, radii = [], []
    for place in np.linspace(first, ENDS[1], CUTS):
        cut = _cut(subject, weights > 0.5, places - place)
        middle = 0.5 * (cut.max(axis=0) + cut.min(axis=0))
        middle += (place - (middle - start) @ along) * (end - start)  # back into the plane
        centres.append(middle)
        radii.append(np.linalg.norm(cut - middle, axis=1).max())
    return joint, _pairs(np.stack(centres)), _pairs(np.array(radii))


def hip_sections(subject: Subject) -> list[Section]:
    """Horizontal cuts from the waist down to the thighs, the waist first.

    Raises:
        SettingsError: If the subject is a bust, or its mesh has gaps.
    """
    bones = _bones(subject)
    hip, knee = (float(bones.at[bones.index(f"{n}.L"), 1]) for n in ("upperleg01", "lowerleg01"))
    heights = np.linspace(waist_height(subject), hip - SEAT * (hip - knee), CUTS)
    gap = float(heights[0] - heights[1])
    below = [trunk_section(subject, float(height), gap) for height in heights[1:]]
    grown = [replace(section, radius=section.radius + BULGE) for section in below]
    # Alone: a waistband fits closely.
    return [trunk_section(subject, float(heights[0])), *grown]


def _hips(subject: Subject) -> tuple[str, np.ndarray, np.ndarray]:
    """Name of the joint, ends (C, 2, 3) and radii (C, 2) of what lies between waist and thighs."""
    sections = hip_sections(subject)
    across = np.stack([section.ends() for section in sections])  # (CUTS, 2, 3)
    radii = np.array([section.radius for section in sections])
    ends = [across, _pairs(across[:, 0]), _pairs(across[:, 1])]
    return (
        _bones(subject).names[0],
        np.concatenate(ends),
        np.concatenate([np.stack([radii, radii], 1), _pairs(radii), _pairs(radii)]),
    )


def _pairs(values: np.ndarray) -> np.ndarray:
    """(N - 1, 2, …) neighbours of (N, …)."""
    return np.stack([values[:-1], values[1:]], axis=1)
