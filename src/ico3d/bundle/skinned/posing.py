"""The reference evaluator of a body on a skeleton; shaders are tested against it."""

from dataclasses import dataclass

import numpy as np

from ico3d.bundle.skinned.baked import QUAT_UNIT, SCALE_UNITS, WEIGHT_UNIT, BakedSkinned
from ico3d.rig.quaternions import Array, multiply, normalized, slerp

_FIRST = 0.4886025119029199
_SECOND = (1.0925484305920792, 0.31539156525252005, 0.5462742152960396)
"""Of real spherical harmonics of degrees 1 and 2."""
FARTHER = 0.5
"""Of the distance to the nearest known pose, by which the kernel is wider."""


@dataclass(frozen=True, eq=False)
class SkinnedPose:
    """A pose as it is drawn.

    Attributes:
        rotations: (J, 4) wxyz of each joint about itself, of length 1.
        root: (3,) metres that the root moves from rest.
        residual: (K,) coefficients of the residual shapes.
    """

    rotations: Array
    root: Array
    residual: Array


@dataclass(frozen=True, eq=False)
class PosedGaussians:
    """Gaussians in the world; float32.

    Attributes:
        means: (N, 3) metres.
        quats: (N, 4) wxyz normalised.
        scales: (N, 3) metres.
        rgb: (N, 3) display colours.
        opacities: (N,).
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    rgb: np.ndarray
    opacities: np.ndarray


def recorded_pose(baked: BakedSkinned, frame: float) -> SkinnedPose:
    """The recorded pose at a frame, which is clamped to the clip.

    Between frames joints turn on the shorter arc; the root and the coefficients go straight.
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
    """(F, J, 4) of all joints about themselves, in all recorded frames."""
    shape = (baked.info.num_frames, *baked.held.shape)
    rotations = np.broadcast_to(normalized(baked.held / QUAT_UNIT), shape).copy()
    rotations[:, baked.moving] = normalized(baked.rotations / QUAT_UNIT)
    return rotations


def any_pose(baked: BakedSkinned, rotations: Array, root: Array) -> SkinnedPose:
    """A pose that need not have been recorded.

    Its coefficients are a mean of those of the known poses, weighted by a Gaussian kernel
    (`ico3d.body.skinning.coefficients.interpolated`).

    Args:
        baked: The body.
        rotations: (J, 4) wxyz of each joint about itself.
        root: (3,) metres that the root moves from rest.
    """
    rotations = normalized(np.asarray(rotations, np.float64))
    known = np.repeat(baked.held[None] / QUAT_UNIT, len(baked.known), 0)  # (P, J, 4)
    known[:, baked.moving] = baked.rotations[baked.known] / QUAT_UNIT
    away = np.square(_features(known) - _features(rotations)).sum(1)  # (P,)
    square = float(baked.kernel_width[0]) ** 2 + FARTHER**2 * away.min()
    parts = np.exp((away.min() - away) / (2 * square))  # (P,)
    residual = (parts / parts.sum()) @ baked.coefficients[baked.known]  # (K,)
    return SkinnedPose(rotations, np.asarray(root, np.float64), residual)


def joint_table(baked: BakedSkinned, pose: SkinnedPose) -> Array:
    """(J, 16) what takes each joint's points from rest to the world.

    A row holds the rows of the matrix (R | t) of x ↦ R·x + t (12), and the quaternion wxyz of R
    (4), whose sign agrees with its parent's.
    """
    signed = np.where(pose.rotations[:, :1] < 0, -1.0, 1.0) * pose.rotations  # (J, 4)
    matrices = baked.rig.matrices(signed, pose.root)[:, :3]  # (J, 3, 4)
    quats = signed.copy()
    for joint, parent in enumerate(baked.rig.parents[1:], 1):
        quats[joint] = multiply(quats[parent], signed[joint])
    return np.concatenate([matrices.reshape(-1, 12), quats], 1)


def posed(baked: BakedSkinned, pose: SkinnedPose, count: int | None = None) -> PosedGaussians:
    """The Gaussians in a pose.

    Args:
        baked: The body.
        pose: How it stands.
        count: Draws so many, the most important ones; by default all.
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


def kernel_width(rotations: Array) -> float:
    """How far known poses (P, M, 4) reach: twice the median distance to the nearest other one."""
    places = _features(rotations)  # (P, 3·M)
    if len(places) < 2:
        return 1.0
    squares = np.square(places).sum(1)
    between = squares[:, None] + squares - 2 * places @ places.T  # (P, P)
    np.fill_diagonal(between, np.inf)
    nearest = np.sqrt(np.maximum(between.min(1), 0))  # (P,)
    # As torch.median, which takes the lower of two in the middle.
    return max(2.0 * float(np.sort(nearest)[(len(nearest) - 1) // 2]), 1e-6)


def _features(rotations: Array) -> Array:
    """(..., 3·M) sin(angle / 2) times each joint's axis, of rotations (..., M, 4)."""
    quats = normalized(rotations)
    signed = np.where(quats[..., :1] < 0, -quats, quats)[..., 1:]  # (..., M, 3)
    return signed.reshape(*signed.shape[:-2], -1)
