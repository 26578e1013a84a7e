"""Camera poses: orthonormalised rotations, and worlds turned so that +y is up."""

from collections.abc import Sequence

import numpy as np

from ico3d.errors import CaptureError


def up_of_cameras(cameras_to_world: Sequence[np.ndarray]) -> np.ndarray:
    """(3,) mean upward direction of cameras (4, 4) in OpenCV axes, assumed to be held upright."""
    ups = -np.stack([matrix[:3, 1] for matrix in cameras_to_world])  # (C, 3)
    mean = ups.mean(0)
    length = float(np.linalg.norm(mean))
    return mean / length if length > 1e-6 else np.array([0.0, 1.0, 0.0])


def nearest_axis(direction: np.ndarray) -> np.ndarray:
    """(3,) the coordinate axis, with its sign, that is nearest to a direction."""
    axis = np.zeros(3)
    largest = int(np.abs(direction).argmax())
    axis[largest] = 1.0 if direction[largest] >= 0 else -1.0
    return axis


def turn_upright(up: np.ndarray) -> np.ndarray:
    """The smallest rotation (3, 3) that takes a unit vector to +y.

    For coordinate axes the entries are exactly 0 and ±1.
    """
    x, y, z = (float(value) for value in up)
    if y < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    # Rodrigues about up x +y, whose sine is its length and whose cosine is y.
    axis = np.array([[0.0, -x, 0.0], [x, 0.0, z], [0.0, -z, 0.0]])
    return np.eye(3) + axis + axis @ axis / (1 + y)


def turned(rotation: np.ndarray, camera_to_world: np.ndarray) -> np.ndarray:
    """A camera's pose (4, 4) in a world that was turned by a rotation (3, 3)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation @ camera_to_world[:3, :3]
    matrix[:3, 3] = rotation @ camera_to_world[:3, 3]
    return matrix


def rigid(matrix: np.ndarray, what: str) -> np.ndarray:
    """A (4, 4) pose with its rotation orthonormalised.

    Args:
        matrix: (4, 4) or (3, 4) as the file states it.
        what: Whose pose it is, for errors.

    Returns:
        (4, 4) pose with the nearest rotation matrix.

    Raises:
        CaptureError: If the matrix is far from a rotation with a translation.
    """
    turn = matrix[:3, :3].clip(-2, 2)
    wrong = np.abs(turn @ turn.T - np.eye(3)).max() > 1e-3 or np.linalg.det(turn) < 0
    if wrong or not np.allclose(matrix[3], [0, 0, 0, 1]):
        raise CaptureError(f"{what}: its pose is no rotation and translation.")
    left, _, right = np.linalg.svd(turn)
    pose = matrix.copy()
    pose[:3, :3] = left @ right
    return pose
