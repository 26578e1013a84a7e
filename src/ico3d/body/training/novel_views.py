"""Random cameras between the recording ones, for temporal fine-tuning."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from ico3d.common.camera import Camera

MOST_APART = np.radians(150)
"""Largest rotation in radians between cameras that are mixed; beyond, means make no sense."""
NEIGHBOURS = 2, 3
"""Least and largest number of cameras that a drawn camera is mixed with."""
ITERATIONS = 100
"""Most iterations of `mean_pose`."""
CONVERGED = 1e-12
"""Step of `mean_pose`, in radians and metres, below which it ends."""


def se3_exp(twists: np.ndarray) -> np.ndarray:
    """Rigid transforms (..., 4, 4), the exponentials of twists (..., 6).

    The first three numbers of a twist are the rotational part in radians, the others the
    translational part.
    """
    twists = np.asarray(twists, np.float64)
    flat = RigidTransform.from_exp_coords(twists.reshape(-1, 6)).as_matrix()  # (P, 4, 4)
    return flat.reshape(*twists.shape[:-1], 4, 4)


def se3_log(transforms: np.ndarray) -> np.ndarray:
    """Twists (..., 6) of rigid transforms (..., 4, 4) that rotate by less than π; see `se3_exp`."""
    transforms = np.asarray(transforms, np.float64)
    flat = RigidTransform.from_matrix(transforms.reshape(-1, 4, 4)).as_exp_coords()  # (P, 6)
    return flat.reshape(*transforms.shape[:-2], 6)


def mean_pose(poses: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The weighted intrinsic mean M of poses P_j: the one with Σ w_j · log(M⁻¹·P_j) = 0.

    It is found by iterating M ← M · exp(Σ w_j · log(M⁻¹·P_j)) from the pose of the largest weight.
    Unlike the mean of log(P_j) it does not depend on the world's origin.

    Args:
        poses: (J, 4, 4) camera to world; any two are rotated by less than π.
        weights: (J,) not negative, with sum 1.

    Returns:
        (4, 4) camera to world.
    """
    mean = np.array(poses[int(np.argmax(weights))], np.float64)
    for _ in range(ITERATIONS):
        step = weights @ se3_log(np.linalg.inv(mean) @ poses)  # (6,)
        if np.abs(step).max() < CONVERGED:
            break
        mean = mean @ se3_exp(step)
    return mean


def novel_camera(cameras: Sequence[Camera], rng: np.random.Generator) -> Camera:
    """A random camera between a recorded one and its neighbours in viewing angle.

    Weights of the mixed cameras are drawn from Dirichlet(1). Poses are mixed by `mean_pose`, focal
    lengths geometrically and principal points linearly, both relative to the picture's size,
    which is that of the drawn camera. (The paper's Σ β_c · log(P_c) with free β would leave the
    ring of cameras.)

    Args:
        cameras: The recording cameras. A camera without neighbours within `MOST_APART` is returned
            with its own pose.
        rng: Draws the cameras and their weights.
    """
    poses = np.stack([camera.camera_to_world for camera in cameras])  # (C, 4, 4)
    chosen = _neighbourhood(
        poses, int(rng.integers(len(cameras))), int(rng.integers(*NEIGHBOURS, endpoint=True))
    )
    weights = rng.dirichlet(np.ones(len(chosen)))  # (J,)
    drawn = cameras[chosen[0]]
    sizes = np.array([(c.width, c.height) for c in (cameras[j] for j in chosen)])  # (J, 2)
    intrinsics = np.stack([cameras[j].intrinsics for j in chosen])  # (J, 3, 3)
    focal = np.exp(weights @ np.log(intrinsics[:, (0, 1), (0, 1)] / sizes)) * sizes[0]  # (2,)
    middle = weights @ (intrinsics[:, :2, 2] / sizes) * sizes[0]  # (2,)
    mixed = np.array([[focal[0], 0, middle[0]], [0, focal[1], middle[1]], [0, 0, 1]])
    pose = mean_pose(poses[chosen], weights)
    return Camera(drawn.width, drawn.height, mixed, np.linalg.inv(pose), "novel")


def _neighbourhood(poses: np.ndarray, drawn: int, count: int) -> list[int]:
    """Indices of the drawn camera and up to `count` neighbours, any two within `MOST_APART`."""
    angles = _angles(poses)  # (C, C)
    chosen = [drawn]
    for other in np.argsort(angles[drawn], kind="stable").tolist():
        if len(chosen) > count:
            break
        if other not in chosen and angles[other, chosen].max() <= MOST_APART:
            chosen.append(other)
    return chosen


def _angles(poses: np.ndarray) -> np.ndarray:
    """(C, C) angles in radians of the rotations between cameras of poses (C, 4, 4)."""
    rotations = poses[:, :3, :3]
    cosines = (np.einsum("aij,bij->ab", rotations, rotations) - 1) / 2  # (C, C)
    return np.arccos(np.clip(cosines, -1, 1))
