"""A small body on a skeleton in the real format: random Gaussians, shapes and poses."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.bundle.format import write_bundle
from ico3d.bundle.manifest import Manifest
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.info import SKINNED, SkinnedInfo
from ico3d.bundle.skinned.lamp import POINT_UNIT, BakedLamp
from ico3d.bundle.skinned.packing import packed_quats, packed_weights
from ico3d.bundle.tensors import QUAT_UNIT
from ico3d.rig.pose_regression import kernel_width
from support.bundles.random_body import body_manifest, random_windows
from support.bundles.random_bundle import thumbnail

NAMES = ("root", "chest", "left arm", "left hand", "head")
PARENTS = (-1, 0, 1, 2, 1)
CASTERS = 150
REST = ((0, 1, 0), (0, 1.3, 0), (0.2, 1.4, 0), (0.5, 1.4, 0), (0, 1.5, 0))


def random_skinned(
    count: int = 20, shapes: int = 3, frames: int = 6, turn: float = 0.3, seed: int = 0
) -> BakedSkinned:
    """Of which the root, the chest, the arm and the head turn, by about `turn` radians."""
    rng = np.random.default_rng(seed)
    moving = np.array([0, 1, 2, 4], np.uint8)
    known = np.array([0, 1, 3, 5], np.int16)
    turns = rng.normal(0, turn / 2, (frames, len(moving), 4))
    turns[..., 0] = 1
    rotations = packed_quats(turns)
    joints = np.array(REST, np.float32)
    bone = rng.integers(0, len(NAMES), (count, 4))
    low, high = (0.0, 0.5, -0.5), (1.0, 2.0, 0.5)
    info = SkinnedInfo(
        15.0, frames, count, shapes, len(moving), len(known), NAMES, PARENTS, low, high, CASTERS
    )
    return BakedSkinned(
        means=(joints[bone[:, 0]] + rng.normal(0, 0.1, (count, 3))).astype(np.float32),
        quats=packed_quats(rng.normal(size=(count, 4))),
        log_scales=rng.normal(-4, 0.3, (count, 3)).astype(np.float16),
        color_logits=rng.normal(0, 1.5, (count, 3)).astype(np.float16),
        opacities=rng.integers(100, 256, count).astype(np.uint8),
        normals=rng.integers(-127, 128, (count, 3)).astype(np.int8),
        joints=bone.astype(np.uint8),
        weights=packed_weights(rng.dirichlet(np.ones(4), count)),
        shapes=rng.integers(-127, 128, (count, shapes, 6)).astype(np.int8),
        shape_scales=rng.uniform(0.1, 1, (count, 2)).astype(np.float16) * np.float16(0.1),
        light=rng.normal(0, 0.4, (8, 3)).astype(np.float32),
        rig_joints=joints,
        held=packed_quats(np.array([[1.0, 0, 0, 0]] * 3 + [[1.0, 0, 0.4, 0]] + [[1.0, 0, 0, 0]])),
        moving=moving,
        rotations=rotations,
        roots=rng.normal(0, 0.05, (frames, 3)).astype(np.float32),
        coefficients=rng.normal(0, 1, (frames, shapes)).astype(np.float32),
        known=known,
        kernel_width=np.array([kernel_width(rotations[known] / QUAT_UNIT)], np.float32),
        info=info,
        lamp=_lamp(rng, joints),
    )


def _lamp(rng: np.random.Generator, joints: np.ndarray) -> BakedLamp:
    """Spheres about the joints, among the Gaussians."""
    bone = rng.integers(0, len(NAMES), (CASTERS, 4))
    points = joints[bone[:, 0]] + rng.normal(0, 0.1, (CASTERS, 3))
    return BakedLamp(
        lamp_direction=np.array([0.48, 0.6, 0.64], np.float32),
        lamp_strength=np.array([1.5, 1.2, 0.9], np.float32),
        caster_points=np.rint(points / POINT_UNIT).astype(np.int16),
        caster_joints=bone.astype(np.uint8),
        caster_weights=packed_weights(rng.dirichlet(np.ones(4), CASTERS)),
    )


def skinned_manifest(baked: BakedSkinned) -> Manifest:
    return replace(
        body_manifest(random_windows()), name="random skinned", body=None, skinned=baked.info
    )


def write_random_skinned(path: Path) -> Manifest:
    baked = random_skinned()
    files = {SKINNED: baked.to_bytes(), "thumbnail.png": thumbnail()}
    return write_bundle(path, skinned_manifest(baked), files)
