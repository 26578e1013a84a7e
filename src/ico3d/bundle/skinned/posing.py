"""The reference evaluator of a body on a skeleton; shaders are tested against it."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ico3d.bundle.skinned.baked import SCALE_UNITS, WEIGHT_UNIT, BakedSkinned
from ico3d.bundle.skinned.lamp import lamp_light
from ico3d.bundle.tensors import QUAT_UNIT
from ico3d.rig.pose_regression import PoseRegression
from ico3d.rig.quaternions import Array, multiply, normalized, slerp

_FIRST = 0.4886025119029199
_SECOND = (1.0925484305920792, 0.31539156525252005, 0.5462742152960396)
"""Factors of the real spherical harmonics of degree 1 (`_FIRST`) and 2."""


@dataclass(frozen=True, eq=False)
class SkinnedPose:
    """A pose of the skeleton, with coefficients of the residual shapes.

    Attributes:
        rotations: (J, 4) local rotation of each joint, unit quaternions wxyz.
        root: (3,) translation of the root from rest, metres.
        residual: (K,) coefficients of the residual shapes.
    """

    rotations: Array
    root: Array
    residual: Array


@dataclass(frozen=True, eq=False)
class PosedGaussians:
    """Posed Gaussians in the world; float32 arrays.

    Attributes:
        means: (N, 3) metres.
        quats: (N, 4) unit quaternions wxyz.
        scales: (N, 3) metres.
        rgb: (N, 3) display RGB in [0, 1].
        opacities: (N,) in [0, 1].
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    rgb: np.ndarray
    opacities: np.ndarray


def recorded_pose(baked: BakedSkinned, frame: float) -> SkinnedPose:
    """The recorded pose at a frame, which need not be whole and is clamped to the clip.

    Between frames rotations are interpolated by slerp, root and coefficients linearly.
    """
    place = min(max(frame, 0.0), baked.info.num_frames - 1.0)
    first = min(int(place), baked.info.num_frames - 2)
    part = place - first
    ends = normalized(baked.rotations[first : first + 2] / QUAT_UNIT)  # (2, M, 4)
    rotations = normalized(baked.held / QUAT_UNIT)  # (J, 4)
    rotations[baked.moving] = slerp(ends[0], ends[1], part)
    straight = np.array([1 - part, part])
    return SkinnedPose(
        rotations,
        straight @ baked.roots[first : first + 2],
        straight @ baked.coefficients[first : first + 2],
    )


def recorded_rotations(baked: BakedSkinned) -> Array:
    """(F, J, 4) local rotations wxyz of all joints in all recorded frames."""
    shape = (baked.info.num_frames, *baked.held.shape)
    rotations = np.broadcast_to(normalized(baked.held / QUAT_UNIT), shape).copy()
    rotations[:, baked.moving] = normalized(baked.rotations / QUAT_UNIT)
    return rotations


def any_pose(baked: BakedSkinned, rotations: Array, root: Array) -> SkinnedPose:
    """A pose that need not have been recorded.

    Its coefficients are found from those of the known poses (`PoseRegression`).

    Args:
        baked: The body.
        rotations: (J, 4) local rotation of each joint, wxyz.
        root: (3,) translation of the root from rest, metres.
    """
    rotations = normalized(np.asarray(rotations, np.float64))
    residual = _coefficients(baked).at(rotations)  # (K,)
    return SkinnedPose(rotations, np.asarray(root, np.float64), residual)


@lru_cache(maxsize=4)
def _coefficients(baked: BakedSkinned) -> PoseRegression:
    known = np.repeat(baked.held[None] / QUAT_UNIT, len(baked.known), 0)  # (P, J, 4)
    known[:, baked.moving] = baked.rotations[baked.known] / QUAT_UNIT
    return PoseRegression(known, baked.coefficients[baked.known], float(baked.kernel_width[0]))


def joint_table(baked: BakedSkinned, pose: SkinnedPose) -> Array:
    """(J, 16) rigid transforms x ↦ R·x + t of each joint, from rest space to the world.

    A row holds the three rows of the matrix (R | t) (12 numbers), and the quaternion wxyz of R (4),
    whose sign agrees with that of the parent's quaternion.
    """
    signed = np.where(pose.rotations[:, :1] < 0, -1.0, 1.0) * pose.rotations  # (J, 4)
    matrices = baked.rig.matrices(signed, pose.root)[:, :3]  # (J, 3, 4)
    quats = signed.copy()
    for joint, parent in enumerate(baked.rig.parents[1:], 1):
        quats[joint] = multiply(quats[parent], signed[joint])
    return np.concatenate([matrices.reshape(-1, 12), quats], 1)


def posed(baked: BakedSkinned, pose: SkinnedPose, count: int | None = None) -> PosedGaussians:
    """The Gaussians of a body in a pose.

    Args:
        baked: The body.
        pose: The pose.
        count: Number of Gaussians, the most important ones; by default all.
    """
    some = slice(count)
    table = joint_table(baked, pose).astype(np.float32)
    weights = baked.weights[some] / np.float32(WEIGHT_UNIT)  # (N, 4)
    mixed = np.einsum("nk,nkc->nc", weights, table[baked.joints[some]])  # (N, 16)
    matrices = mixed[:, :12].reshape(-1, 3, 4)  # (N, 3, 4)
    residual = np.einsum("k,nkd->nd", pose.residual, baked.shapes[some].astype(np.float32))
    units = baked.shape_scales[some].astype(np.float64) * SCALE_UNITS  # (N, 2)
    rest = baked.means[some] + residual[:, :3] * units[:, :1]  # (N, 3)
    means = np.einsum("nab,nb->na", matrices[..., :3], rest) + matrices[..., 3]
    facing = np.einsum("nab,nb->na", matrices[..., :3], baked.normals[some].astype(np.float32))
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-6)
    logits = baked.color_logits[some].astype(np.float32) + residual[:, 3:] * units[:, 1:]
    logits = logits + harmonics(facing) @ baked.light  # (N, 3)
    if baked.lamp:
        logits = logits + lamp_light(baked.lamp, table, means, facing)
    quats = normalized(multiply(mixed[:, 12:], baked.quats[some].astype(np.float32)))
    return PosedGaussians(
        means.astype(np.float32),
        quats.astype(np.float32),
        np.exp(baked.log_scales[some].astype(np.float32)),
        # The sigmoid, in the form that never overflows.
        (0.5 + 0.5 * np.tanh(0.5 * logits)).astype(np.float32),
        baked.opacities[some] / np.float32(255),
    )


def harmonics(normals: Array) -> Array:
    """(N, 8) real spherical harmonics of degrees 1 and 2 at unit vectors (N, 3)."""
    x, y, z = normals.T
    a, b, c = _SECOND
    first = [-_FIRST * y, _FIRST * z, -_FIRST * x]
    second = [a * x * y, -a * y * z, b * (2 * z * z - x * x - y * y), -a * x * z]
    return np.stack([*first, *second, c * (x * x - y * y)], 1)
