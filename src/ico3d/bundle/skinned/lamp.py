"""A lamp on a body on a skeleton, and the shadow that the body casts on itself in its light."""

from dataclasses import dataclass, fields

import numpy as np

from ico3d.bundle.skinned.info import SkinnedInfo
from ico3d.bundle.tensors import Spec
from ico3d.rig.quaternions import Array
from ico3d.rig.shadow_map import BIAS, EDGE, FAR, OFF, RADIUS, SIDE, TEXEL, WRAP

POINT_UNIT = 1e-4
"""Metres per unit of `caster_points`."""
WEIGHT_UNIT = 255
"""The sum of a sphere's weights."""
_UNEVEN = 1e-3
"""By which the length of the direction may differ from 1."""
_MOST = 1e4
"""No lamp is stronger, in units of the light from all around."""


@dataclass(frozen=True, eq=False)
class BakedLamp:
    """The strongest lamp, and M spheres just under the skin that stand in its light.

    Attributes:
        lamp_direction: (3,) float32 unit vector towards the lamp, in the world.
        lamp_strength: (3,) float32 ≥ 0, its light r, g, b where it falls straight on, in units of
            the light from all around.
        caster_points: (M, 3) int16 centres at rest in units of 0.1 mm.
        caster_joints: (M, 4) uint8, which joints carry a sphere.
        caster_weights: (M, 4) uint8 in units of 1/255, with the sum 255.
    """

    lamp_direction: np.ndarray
    lamp_strength: np.ndarray
    caster_points: np.ndarray
    caster_joints: np.ndarray
    caster_weights: np.ndarray

    @property
    def tensors(self) -> dict[str, np.ndarray]:
        """What the file holds of it, by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def lamp_spec(info: SkinnedInfo) -> Spec:
    """Its tensors; none where nothing casts a shadow."""
    count = info.num_casters
    if count == 0:
        return {}
    return {
        "lamp_direction": ("F32", (3,)),
        "lamp_strength": ("F32", (3,)),
        "caster_points": ("I16", (count, 3)),
        "caster_joints": ("U8", (count, 4)),
        "caster_weights": ("U8", (count, 4)),
    }


def fault_of(lamp: BakedLamp, num_joints: int) -> str | None:
    """What is wrong with a lamp's values, as the end of a sentence; None where nothing is."""
    if abs(float(np.linalg.norm(lamp.lamp_direction.astype(np.float64))) - 1) > _UNEVEN:
        return "'lamp_direction' is not of length 1"
    if lamp.lamp_strength.min() < 0 or lamp.lamp_strength.max() > _MOST:
        return f"'lamp_strength' must lie between 0 and {_MOST:g}"
    if lamp.caster_joints.max() >= num_joints:
        return "'caster_joints' names one that is not there"
    if (lamp.caster_weights.sum(axis=1, dtype=np.int32) != WEIGHT_UNIT).any():
        return f"'caster_weights' must sum to {WEIGHT_UNIT}"
    return None


def lamp_light(lamp: BakedLamp, table: Array, points: Array, normals: Array) -> Array:
    """(N, 3) what the lamp adds to colour logits.

    Args:
        lamp: The lamp.
        table: (J, 16) of `ico3d.bundle.skinned.posing.joint_table`.
        points: (N, 3) metres in the world.
        normals: (N, 3) unit vectors.
    """
    axes = _axes(lamp.lamp_direction)
    depths = shadow_map(lamp, table)
    places = (points + OFF * normals) @ axes.T  # (N, 3)
    scaled = places[:, :2] / TEXEL  # (N, 2)
    corner = np.floor(scaled)
    reach = np.zeros(len(points))
    for down in range(-1, 3):
        for right in range(-1, 3):
            texel = corner + np.array([right, down])  # (N, 2)
            weight = (1 - np.abs(scaled - texel) / 2).prod(1) / 4  # (N,)
            column, row = texel.astype(np.int64).T % SIDE
            before = places[:, 2] + BIAS - depths[row, column]  # (N,)
            reach += weight * np.clip(before / EDGE + 0.5, 0, 1)
    facing = np.maximum(normals @ lamp.lamp_direction + WRAP, 0)  # (N,)
    return np.log1p((reach * facing)[:, None] * lamp.lamp_strength)


def shadow_map(lamp: BakedLamp, table: Array) -> Array:
    """(SIDE, SIDE) metres towards the lamp that the nearest sphere reaches at each texel.

    Args:
        lamp: The lamp.
        table: (J, 16) of a pose.
    """
    weights = lamp.caster_weights / WEIGHT_UNIT  # (M, 4)
    mixed = np.einsum("mk,mkc->mc", weights, table[lamp.caster_joints, :12])  # (M, 12)
    matrices = mixed.reshape(-1, 3, 4)
    rest = lamp.caster_points * POINT_UNIT  # (M, 3)
    centres = np.einsum("mab,mb->ma", matrices[..., :3], rest) + matrices[..., 3]
    centres = centres @ _axes(lamp.lamp_direction).T  # (M, 3)
    depths = np.full((SIDE, SIDE), FAR)
    reach = int(RADIUS / TEXEL) + 1
    middle = np.rint(centres[:, :2] / TEXEL)  # (M, 2)
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            texel = middle + np.array([right, down])  # (M, 2)
            apart = np.square(texel * TEXEL - centres[:, :2]).sum(1)  # (M,)
            inside = apart <= RADIUS**2
            depth = centres[inside, 2] + np.sqrt(RADIUS**2 - apart[inside])
            column, row = texel[inside].astype(np.int64).T % SIDE
            np.maximum.at(depths, (row, column), depth)
    return depths


def _axes(direction: np.ndarray) -> Array:
    """(3, 3) rows: across, up and towards the lamp, of length 1."""
    towards = direction.astype(np.float64) / np.linalg.norm(direction)
    up = (0.0, 1.0, 0.0) if abs(towards[1]) < 0.99 else (0.0, 0.0, 1.0)
    across = np.cross(up, towards)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(towards, across), towards])
