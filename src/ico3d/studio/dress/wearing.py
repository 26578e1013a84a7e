"""Puts swinging garments on synthetic people."""

from dataclasses import replace

import numpy as np

from ico3d.errors import SettingsError
from ico3d.studio.acting.performance import Performance
from ico3d.studio.dress.fabric import Course, hung
from ico3d.studio.dress.limbs import Limbs, limbs_of, waist_height
from ico3d.studio.dress.skirt import Skirt, cut_skirt
from ico3d.studio.person.subject import Material, Subject

GARMENTS = ("none", "skirt")
TUCKED = 0.02
"""Metres below the waist at which a shirt under a skirt ends."""
PELVIS = 0
"""Index of the root joint of the skeleton, which carries the waistband."""


def dressed(
    subject: Subject, acted: Performance, garment: str, fps: float
) -> tuple[Subject, Performance]:
    """A person and a performance, with a garment over the person's clothes.

    Args:
        subject: A whole person.
        acted: Performance of the whole body.
        garment: One of `GARMENTS`; `none` changes nothing.
        fps: Frames per second.

    Returns:
        The person with the garment's mesh added, and the performance with the cloth's positions.

    Raises:
        SettingsError: If the subject is a bust, or the performance has no body.
    """
    if garment == "none":
        return subject, acted
    tucked = tucked_in(subject)
    skirt = cut_skirt(tucked)
    wearer = _with(tucked, skirt)
    return wearer, replace(acted, cloth=_moving(wearer, limbs_of(tucked), acted, skirt, fps))


def tucked_in(subject: Subject) -> Subject:
    """The person without the part of a shirt that lies below the waist, under a skirt."""
    height = subject.vertices[:, 1][subject.faces].max(axis=1)  # (F,)
    kept = (subject.materials != Material.CLOTH) | (height > waist_height(subject) - TUCKED)
    return replace(
        subject,
        faces=subject.faces[kept],
        materials=subject.materials[kept],
        corner_uv=subject.corner_uv[kept],
    )


def _with(subject: Subject, skirt: Skirt) -> Subject:
    """The person with the skirt's points behind all others, hung on the pelvis."""
    bones = subject.skeleton
    assert bones is not None  # only a whole person has a skirt cut
    points = skirt.cloth.points
    weights = np.zeros((len(points), len(bones.names)), np.float32)
    weights[:, PELVIS] = 1
    return replace(
        subject,
        vertices=np.concatenate([subject.vertices, points]).astype(np.float32),
        faces=np.concatenate([subject.faces, skirt.faces + np.int32(len(subject.vertices))]),
        materials=np.append(subject.materials, np.full(len(skirt.faces), Material.SKIRT, np.uint8)),
        corner_uv=np.concatenate([subject.corner_uv, skirt.corner_uv]),
        lip_mask=np.append(subject.lip_mask, np.zeros(len(points), np.float32)),
        skeleton=replace(bones, weights=np.concatenate([bones.weights, weights])),
    )


def _moving(
    wearer: Subject, limbs: Limbs, acted: Performance, skirt: Skirt, fps: float
) -> np.ndarray:
    """(F, N, 3) float32 the skirt's points in the world."""
    bones, joints = wearer.skeleton, acted.joints
    if bones is None or joints is None:
        raise SettingsError(f"{wearer.name} does not move as a whole person: record a body.")
    cloth = skirt.cloth
    rest = np.tile(np.eye(4), (1, len(bones.names), 1, 1))
    rest[..., :3, 3] = wearer.head_in_world
    matrices = np.concatenate([rest, joints])  # (1 + F, J, 4, 4)
    band = matrices[:, PELVIS]
    waist = cloth.points[: cloth.pinned]
    pins = np.einsum("fab,pb->fpa", band[:, :3, :3], waist) + band[:, None, :3, 3]
    ends = limbs.posed(matrices)
    course = Course((pins[0], ends[0]), pins[1:], ends[1:], limbs.radii, fps)
    return hung(cloth, course).astype(np.float32)
