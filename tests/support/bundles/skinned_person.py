"""A person of capsules on a skeleton, with shapes, light and motion, in the bundle's format."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.bundle.format import write_bundle
from ico3d.bundle.manifest import CameraInfo, Manifest
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.info import SKINNED, SkinnedInfo
from ico3d.bundle.skinned.lamp import POINT_UNIT, BakedLamp
from ico3d.bundle.skinned.packing import packed_quats, packed_rotations, packed_weights
from ico3d.bundle.tensors import QUAT_UNIT
from ico3d.rig.pose_regression import kernel_width
from ico3d.rig.quaternions import Array, from_rotvec
from ico3d.rig.shadow_map import RADIUS
from support.bundles.random_body import body_manifest, random_windows
from support.bundles.random_bundle import thumbnail

FPS, FRAMES, SHAPES, CASTERS = 15.0, 31, 8, 2000
BONES = {  # joint: (parent, place, end of the capsule, radius)
    "hips": (None, (0.0, 0.95, 0.0), (0.0, 1.1, 0.0), 0.14),
    "chest": ("hips", (0.0, 1.15, 0.0), (0.0, 1.42, 0.0), 0.15),
    "head": ("chest", (0.0, 1.52, 0.0), (0.0, 1.68, 0.0), 0.1),
    "left arm": ("chest", (0.19, 1.42, 0.0), (0.45, 1.42, 0.0), 0.05),
    "left forearm": ("left arm", (0.46, 1.42, 0.0), (0.72, 1.42, 0.0), 0.04),
    "right arm": ("chest", (-0.19, 1.42, 0.0), (-0.45, 1.42, 0.0), 0.05),
    "right forearm": ("right arm", (-0.46, 1.42, 0.0), (-0.72, 1.42, 0.0), 0.04),
    "left leg": ("hips", (0.1, 0.9, 0.0), (0.1, 0.05, 0.0), 0.07),
    "right leg": ("hips", (-0.1, 0.9, 0.0), (-0.1, 0.05, 0.0), 0.07),
    "jaw": ("head", (0.0, 1.58, 0.05), (0.0, 1.56, 0.08), 0.03),
}
NAMES = tuple(BONES)
PARENTS = tuple(-1 if bone[0] is None else NAMES.index(bone[0]) for bone in BONES.values())
NEAR = 0.05
"""Metres from a bone at which another one carries a third as much."""
UNSEEN = {"left arm": (0, 0.4, 0.9), "left forearm": (0, -1.6, 0.3), "head": (0.4, 0.3, 0)}
"""Rotation vectors of a pose that the motion never shows."""


def capsule_person(count: int, frames: int = FRAMES, seed: int = 0) -> BakedSkinned:
    """Gaussians in random order on capsules; the jaw never turns."""
    rng = np.random.default_rng(seed)
    starts, ends = (np.array([bone[i] for bone in BONES.values()]) for i in (1, 2))
    radii = np.array([bone[3] for bone in BONES.values()])
    sizes = (np.linalg.norm(ends - starts, axis=1) + radii) * radii
    bone = rng.choice(len(BONES), count, p=sizes / sizes.sum())  # (N,)
    along = rng.uniform(0, 1, (count, 1))
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    means = starts[bone] + along * (ends - starts)[bone] + normals * radii[bone, None]
    joints, weights = _carried(means, starts, ends, radii)
    colors = rng.normal(0, 1.2, (len(BONES), 3))[bone] + rng.normal(0, 0.2, (count, 3))
    size = 0.7 / np.sqrt(count)
    held, moving, rotations = packed_rotations(from_rotvec(_motion(frames)), 0.05)
    known = np.arange(0, frames, 2, dtype=np.int16)
    info = SkinnedInfo(
        FPS, frames, count, SHAPES, len(moving), len(known), NAMES, PARENTS,
        (-0.8, 0.0, -0.4), (0.8, 1.9, 0.6), CASTERS,
    )  # fmt: skip
    phases = np.linspace(0, 2 * np.pi, frames)[:, None]
    return BakedSkinned(
        means=means.astype(np.float32),
        quats=packed_quats(rng.normal(size=(count, 4))),
        log_scales=np.log(rng.uniform(0.5, 1.5, (count, 3)) * size).astype(np.float16),
        color_logits=colors.astype(np.float16),
        opacities=rng.integers(150, 256, count).astype(np.uint8),
        normals=np.rint(normals * 127).astype(np.int8),
        joints=joints,
        weights=packed_weights(weights),
        shapes=rng.integers(-127, 128, (count, SHAPES, 6)).astype(np.int8),
        shape_scales=np.tile([4 / 127, 0.3 / 127], (count, 1)).astype(np.float16),
        light=rng.normal(0, 0.3, (8, 3)).astype(np.float32),
        rig_joints=starts.astype(np.float32),
        held=held,
        moving=moving,
        rotations=rotations,
        roots=(np.sin(phases) * (0.06, 0.01, 0.03)).astype(np.float32),
        coefficients=np.sin(phases * np.arange(1, SHAPES + 1) / 2).astype(np.float32),
        known=known,
        kernel_width=np.array([kernel_width(rotations[known] / QUAT_UNIT)], np.float32),
        info=info,
        lamp=_lamp(starts, ends, radii, sizes),
    )


def _lamp(starts: Array, ends: Array, radii: Array, sizes: Array) -> BakedLamp:
    """Under the skin, lit from above and the left, so that arms shade the trunk."""
    rng = np.random.default_rng(7)
    bone = rng.choice(len(BONES), CASTERS, p=sizes / sizes.sum())  # (M,)
    outward = rng.normal(size=(CASTERS, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    points = starts[bone] + rng.uniform(0, 1, (CASTERS, 1)) * (ends - starts)[bone]
    points += outward * (radii[bone, None] - RADIUS)
    joints, weights = _carried(points, starts, ends, radii)
    return BakedLamp(
        lamp_direction=np.array([0.6, 0.48, 0.64], np.float32),
        lamp_strength=np.array([1.3, 1.1, 0.8], np.float32),
        caster_points=np.rint(points / POINT_UNIT).astype(np.int16),
        caster_joints=joints,
        caster_weights=packed_weights(weights),
    )


def unseen_pose() -> Array:
    """(J, 4) rotations."""
    return from_rotvec(np.array([UNSEEN.get(name, (0.0, 0.0, 0.0)) for name in NAMES], float))


def write_capsule_person(path: Path, count: int, frames: int = FRAMES) -> Manifest:
    baked = capsule_person(count, frames)
    camera = CameraInfo((0.6, 1.2, 4.2), (0.0, 0.95, 0.0), (0.0, 1.0, 0.0), 30.0)
    manifest = replace(
        body_manifest(random_windows()),
        name="Capsules",
        body=None,
        skinned=baked.info,
        camera=camera,
    )
    return write_bundle(path, manifest, {SKINNED: baked.to_bytes(), "thumbnail.png": thumbnail()})


def _carried(
    points: Array, starts: Array, ends: Array, radii: Array
) -> tuple[np.ndarray, np.ndarray]:
    """Joints (N, 4) of the nearest bones, the nearest first, and weights (N, 4)."""
    bones = ends - starts  # (J, 3)
    part = ((points[:, None] - starts) * bones).sum(2) / (bones**2).sum(1)  # (N, J)
    nearest = starts + part.clip(0, 1)[..., None] * bones  # (N, J, 3)
    away = np.linalg.norm(points[:, None] - nearest, axis=2) - radii  # (N, J)
    joints = np.argsort(away, axis=1)[:, :4]  # (N, 4)
    gap = np.take_along_axis(away, joints, 1)
    weights = np.exp(-(gap - gap[:, :1]) / NEAR)
    weights[weights < 0.05] = 0
    return joints.astype(np.uint8), weights / weights.sum(1, keepdims=True)


def _motion(frames: int) -> Array:
    """(F, J, 3) rotation vectors of somebody who waves, turns and walks on the spot."""
    t = np.linspace(0, 2 * np.pi, frames)
    turns = np.zeros((frames, len(NAMES), 3))
    turns[:, NAMES.index("hips"), 1] = 0.4 * np.sin(t)
    turns[:, NAMES.index("chest"), 1] = 0.3 * np.sin(2 * t)
    turns[:, NAMES.index("head"), 0] = 0.2 * np.sin(3 * t)
    turns[:, NAMES.index("left arm"), 2] = -0.9 + 0.4 * np.sin(t)
    turns[:, NAMES.index("left forearm"), 1] = -0.8 + 0.6 * np.cos(2 * t)
    turns[:, NAMES.index("right arm"), 2] = 1.1 + 0.2 * np.cos(t)
    turns[:, NAMES.index("right forearm"), 2] = 0.3 + 0.3 * np.sin(2 * t)
    turns[:, NAMES.index("left leg"), 0] = 0.4 * np.sin(2 * t)
    turns[:, NAMES.index("right leg"), 0] = -0.4 * np.sin(2 * t)
    turns[:, NAMES.index("jaw"), 0] = 0.1
    return turns
