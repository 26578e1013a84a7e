"""Round limbs that stand for a body where cloth meets it."""

from dataclasses import dataclass, replace

import numpy as np

from ico3d.errors import SettingsError
from ico3d.studio.person.skeleton import Skeleton
from ico3d.studio.person.subject import CARDS, Subject

THIGH = ("upperleg01", "upperleg02")
SHIN = ("lowerleg01", "lowerleg02")
ARM = ("clavicle", "shoulder", "upperarm", "lowerarm", "wrist", "metacarpal", "finger")
"""How the names of bones begin, MakeHuman's default rig."""
WAIST = "spine04"
"""The joint at whose height a skirt is hung."""
CUTS = 4
"""Sections that are taken of a limb."""
PLANES = 9
"""Planes that stand for a slice of the hips: the hem of a shirt lies between two sections."""
BULGE = 0.006
"""Metres that hips grow where a leg turns in them: their skin follows the thigh in part."""
ENDS = (0.05, 0.95)
"""Where the first and the last one lie, in lengths of the bone."""
SEAT = 0.15
"""How far the hips reach below the hip joints, in lengths of a thigh."""
ROUND = 0.3
"""Below the hip joint, in lengths of a thigh, where a thigh begins to be round."""


@dataclass(frozen=True)
class Limbs:
    """C segments; the radius changes evenly from one end to the other.

    Attributes:
        joints: (C,) int that carry them.
        ends: (C, 2, 3) metres, canonical head space at rest.
        radii: (C, 2) metres.
    """

    joints: np.ndarray
    ends: np.ndarray
    radii: np.ndarray

    def posed(self, matrices: np.ndarray) -> np.ndarray:
        """(F, C, 2, 3) ends of the segments, moved by joints (F, J, 4, 4)."""
        carried = matrices[:, self.joints]  # (F, C, 4, 4)
        turned = np.einsum("fcab,ceb->fcea", carried[..., :3, :3], self.ends)
        return turned + carried[:, :, None, :3, 3]


@dataclass(frozen=True)
class Section:
    """What a horizontal plane cuts of a trunk, as a stadium that lies across.

    Attributes:
        height: Metres, canonical head space at rest.
        middle: Its middle along Z.
        half_length: Half of the straight part, along X.
        radius: Of its round ends; nothing lies outside.
    """

    height: float
    middle: float
    half_length: float
    radius: float

    def ends(self) -> np.ndarray:
        """(2, 3) centres of its round ends, left and right."""
        left = np.array([self.half_length, self.height, self.middle])
        return np.stack([left, left * (-1, 1, 1)])


def limbs_of(subject: Subject) -> Limbs:
    """Hips, thighs and shins of a whole person.

    Raises:
        SettingsError: If the mesh has nothing where one of them should be.
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
    """The trunk without arms, cut by a horizontal plane.

    Args:
        subject: A whole person at rest.
        height: Metres, canonical head space.
        around: Metres up and down within which more planes are cut; the section is as wide and
            deep as the widest and deepest of them.

    Raises:
        SettingsError: If there is nothing at that height.
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
    """Metres, canonical head space at rest."""
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
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
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
    """Sections of what lies between waist and thighs, the waist first.

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
