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


def lamp_light(
    lamp: BakedLamp, table: Array, points: Array, normals: Array, sky: Array | float = 1.0
) -> Array:
    """(N, 3) what the lamp adds to colour logits, and what they lose by hidden sky.

    Args:
        lamp: The lamp.
        table: (J, 16) of `ico3d.bundle.skinned.posing.joint_table`.
        points: (N, 3) metres in the world.
        normals: (N, 3) unit vectors.
        sky: (N,) share of the light from all around that reaches the points.
    """
    axes = lamp_axes(lamp.lamp_direction)
    depths = shadow_map(posed_casters(lamp, table), axes)
    reach = reached(points, normals, axes, depths)  # (N,)
    facing = np.maximum(normals @ lamp.lamp_direction + WRAP, 0)  # (N,)
    around = np.broadcast_to(sky, reach.shape)[:, None]  # (N, 1)
    return np.log(around + (reach * facing)[:, None] * lamp.lamp_strength)


def posed_casters(lamp: BakedLamp, table: Array) -> Array:
    """(M, 3) centres of the spheres in the world, in a pose with the joint table (J, 16)."""
    matrices = caster_matrices(lamp, table)
    rest = lamp.caster_points * POINT_UNIT  # (M, 3)
    return np.einsum("mab,mb->ma", matrices[..., :3], rest) + matrices[..., 3]


def caster_matrices(lamp: BakedLamp, table: Array) -> Array:
    """(M, 3, 4) matrices (R | t) that move the spheres from rest to a pose."""
    weights = lamp.caster_weights / WEIGHT_UNIT  # (M, 4)
    mixed = np.einsum("mk,mkc->mc", weights, table[lamp.caster_joints, :12])  # (M, 12)
    return mixed.reshape(-1, 3, 4)


def reached(points: Array, normals: Array, axes: Array, depths: Array) -> Array:
    """(N,) share of a distant light that reaches points on the skin.

    Args:
        points: (N, 3) metres in the world.
        normals: (N, 3) unit vectors.
        axes: (3, 3) of `lamp_axes`.
        depths: (SIDE, SIDE) of `shadow_map`.
    """
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
    return reach


def shadow_map(centres: Array, axes: Array) -> Array:
    """(SIDE, SIDE) metres towards a light that the nearest sphere reaches at each texel.

    Args:
        centres: (M, 3) of the spheres in the world, metres.
        axes: (3, 3) of `lamp_axes`.
    """
    seen = centres @ axes.T  # (M, 3)
    depths = np.full((SIDE, SIDE), FAR)
    reach = int(RADIUS / TEXEL) + 1
    middle = np.rint(seen[:, :2] / TEXEL)  # (M, 2)
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            texel = middle + np.array([right, down])  # (M, 2)
            apart = np.square(texel * TEXEL - seen[:, :2]).sum(1)  # (M,)
            inside = apart <= RADIUS**2
            depth = seen[inside, 2] + np.sqrt(RADIUS**2 - apart[inside])
            column, row = texel[inside].astype(np.int64).T % SIDE
            np.maximum.at(depths, (row, column), depth)
    return depths


def lamp_axes(direction: np.ndarray) -> Array:
    """(3, 3) rows: across, up and towards a light in a direction (3,), of length 1."""
    towards = direction.astype(np.float64) / np.linalg.norm(direction)
    up = (0.0, 1.0, 0.0) if abs(towards[1]) < 0.99 else (0.0, 0.0, 1.0)
    across = np.cross(up, towards)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(towards, across), towards])
