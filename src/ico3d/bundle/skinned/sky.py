"""How much of the light from all around reaches a body on a skeleton in a pose."""

from dataclasses import dataclass, fields

import numpy as np

from ico3d.bundle.skinned.info import SkinnedInfo
from ico3d.bundle.skinned.lamp import (
    WEIGHT_UNIT,
    BakedLamp,
    caster_matrices,
    lamp_axes,
    posed_casters,
    reached,
    shadow_map,
)
from ico3d.bundle.tensors import Axes, Spec
from ico3d.common.spread import directions
from ico3d.rig.quaternions import Array
from ico3d.rig.shadow_map import RADIUS, SKY_LEAST

SKY_AXES: Axes = {"sky_casters": 0, "sky_weights": 0}
"""Tensors with one row per Gaussian."""


@dataclass(frozen=True, eq=False)
class BakedSky:
    """Where M spheres face, and above which of them N Gaussians see the sky.

    Attributes:
        caster_normals: (M, 3) int8 directions out of the body at rest, of any length but 0.
        sky_casters: (N, 4) uint16 indices of spheres.
        sky_weights: (N, 4) uint8 in units of 1/255, with the sum 255.
    """

    caster_normals: np.ndarray
    sky_casters: np.ndarray
    sky_weights: np.ndarray

    @property
    def tensors(self) -> dict[str, np.ndarray]:
        """What the file holds of it, by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def sky_spec(info: SkinnedInfo) -> Spec:
    """Its tensors; none where the body hides no light from itself."""
    if info.num_sky == 0:
        return {}
    return {
        "caster_normals": ("I8", (info.num_casters, 3)),
        "sky_casters": ("U16", (info.num_gaussians, 4)),
        "sky_weights": ("U8", (info.num_gaussians, 4)),
    }


def sky_fault(sky: BakedSky) -> str | None:
    """What is wrong with its values, as the end of a sentence; None where nothing is."""
    if not sky.caster_normals.any(axis=1).all():
        return "'caster_normals' holds one without a direction"
    if sky.sky_casters.max() >= len(sky.caster_normals):
        return "'sky_casters' names one that is not there"
    if (sky.sky_weights.sum(axis=1, dtype=np.int32) != WEIGHT_UNIT).any():
        return f"'sky_weights' must sum to {WEIGHT_UNIT}"
    return None


def sky_light(sky: BakedSky, lamp: BakedLamp, count: int, table: Array, some: slice) -> Array:
    """(N,) share of the light from all around that reaches Gaussians in a pose.

    Args:
        sky: What Gaussians see it by.
        lamp: The spheres that hide it.
        count: Number of directions, `SkinnedInfo.num_sky`.
        table: (J, 16) of `ico3d.bundle.skinned.posing.joint_table`.
        some: Which Gaussians.
    """
    seen = _seen(sky, lamp, count, table)  # (M,)
    return (seen[sky.sky_casters[some]] * (sky.sky_weights[some] / WEIGHT_UNIT)).sum(1)


def _seen(sky: BakedSky, lamp: BakedLamp, count: int, table: Array) -> Array:
    """(M,) share of the light from all around that reaches the skin above the spheres."""
    centres = posed_casters(lamp, table)  # (M, 3)
    turns = caster_matrices(lamp, table)[..., :3]
    facing = np.einsum("mab,mb->ma", turns, sky.caster_normals.astype(np.float64))  # (M, 3)
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-6)
    skin = centres + RADIUS * facing
    seen, possible = np.zeros(len(skin)), np.full(len(skin), 1e-6)
    for direction in directions(count):
        cosine = np.maximum(facing @ direction, 0)  # (M,)
        axes = lamp_axes(direction)
        seen += cosine * reached(skin, facing, axes, shadow_map(centres, axes))
        possible += cosine
    return np.maximum(seen / possible, SKY_LEAST)
