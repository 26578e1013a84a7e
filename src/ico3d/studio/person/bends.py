"""Lets cloth bend softly where limbs leave the trunk: files hang it there on single joints."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from ico3d.studio.person.edges import sides
from ico3d.studio.person.subject import Material, Subject

ARMPIT, FORK = 0.13, 0.09
"""Metres about a shoulder's joint, and about where the legs of trousers meet, in which weights are
smoothed."""
SOFTER = 40
"""How often they are."""
BELOW = 0.10
"""How far below the hips the legs of trousers meet, metres."""


def with_soft_bends(subject: Subject) -> Subject:
    """The person whose jumper and trousers bend over a hand's breadth, without shards or knots."""
    bones = subject.skeleton
    if bones is None:
        return subject
    arms, hips = (
        np.stack([bones.at[bones.index(f"{joint}.{side}")] for side in "LR"])
        for joint in ("upperarm01", "upperleg01")
    )
    fork = hips.mean(axis=0, keepdims=True) - (0.0, BELOW, 0.0)
    weights = bones.weights.copy()
    _soften(weights, subject, Material.CLOTH, arms, ARMPIT)
    _soften(weights, subject, Material.TROUSERS, fork, FORK)
    return replace(subject, skeleton=replace(bones, weights=weights))


def _soften(
    weights: np.ndarray, subject: Subject, material: Material, places: np.ndarray, reach: float
) -> None:
    """Smooths weights (V, J) of a garment near places (P, 3), in place."""
    cloth = subject.faces[subject.materials == material]
    worn = np.unique(cloth)
    if len(worn) == 0:
        return
    a, b = np.searchsorted(worn, np.unique(sides(cloth), axis=0)).T
    rows, columns = np.r_[a, b], np.r_[b, a]
    share_of = 1 / np.bincount(rows, minlength=len(worn))
    around = csr_array((share_of[rows], (rows, columns)), shape=(len(worn), len(worn)))
    away = np.linalg.norm(subject.vertices[worn] - places[:, None], axis=2).min(axis=0)  # (N,)
    share = np.exp(-((away / reach) ** 2))[:, None]  # (N, 1)
    for _ in range(SOFTER):
        own = weights[worn]
        weights[worn] = own + share * (around @ own - own)  # towards the mean of the neighbours
