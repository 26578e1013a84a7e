"""Poses of cameras: made exact, and worlds turned so that +y is up."""

from collections.abc import Sequence

import numpy as np

from ico3d.errors import CaptureError


def up_of_cameras(cameras_to_world: Sequence[np.ndarray]) -> np.ndarray:
    """(3,) mean upward direction of (4, 4) OpenCV cameras, which people hold upright."""
    ups = -np.stack([matrix[:3, 1] for matrix in cameras_to_world])  # (C, 3)
    mean = ups.mean(0)
    length = float(np.linalg.norm(mean))
    return mean / length if length > 1e-6 else np.array([0.0, 1.0, 0.0])


def nearest_axis(direction: np.ndarray) -> np.ndarray:
    """(3,) the signed coordinate axis nearest to a direction."""
    axis = np.zeros(3)
    largest = int(np.abs(direction).argmax())
    axis[largest] = 1.0 if direction[largest] >= 0 else -1.0
    return axis


def turn_upright(up: np.ndarray) -> np.ndarray:
    """The smallest rotation (3, 3) that takes a unit direction to +y.

    Directions along coordinate axes give matrices of exact zeros and ones.
    """
    x, y, z = (float(value) for value in up)
    if y < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    # Rodrigues about up x +y, whose sine is its length and whose cosine is y.
    axis = np.array([[0.0, -x, 0.0], [x, 0.0, z], [0.0, -z, 0.0]])
    return np.eye(3) + axis + axis @ axis / (1 + y)


def turned(rotation: np.ndarray, camera_to_world: np.ndarray) -> np.ndarray:
    """A (4, 4) pose in the world that a (3, 3) rotation makes of the old one."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation @ camera_to_world[:3, :3]
    matrix[:3, 3] = rotation @ camera_to_world[:3, 3]
    return matrix


def rigid(matrix: np.ndarray, what: str) -> np.ndarray:
    """A (4, 4) pose, its rotation made exact.

    Args:
        matrix: (4, 4) or (3, 4) as the file has it.
        what: Whose pose it is, for the error.

    Returns:
        (4, 4) with the nearest rotation.

    Raises:
        CaptureError: If it is no rotation and translation.
    """
    turn = matrix[:3, :3].clip(-2, 2)
    wrong = np.abs(turn @ turn.T - np.eye(3)).max() > 1e-3 or np.linalg.det(turn) < 0
    if wrong or not np.allclose(matrix[3], [0, 0, 0, 1]):
        raise CaptureError(f"{what}: its pose is no rotation and translation.")
    left, _, right = np.linalg.svd(turn)
    pose = matrix.copy()
    pose[:3, :3] = left @ right
    return pose
