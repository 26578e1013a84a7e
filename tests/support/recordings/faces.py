"""A face of 68 landmarks, and heads that move."""

import numpy as np
from scipy.spatial.transform import Rotation

_RIGHT_HALF = {
    **{k: (-0.072 * np.cos(k * np.pi / 16), 0.007 - 0.015 * k, 0.03 + 0.006 * k) for k in range(8)},
    **{17 + k: (-0.06 + 0.011 * k, 0.02 + 0.006 * np.sin(k), 0.075 + 0.005 * k) for k in range(5)},
    31: (-0.014, -0.046, 0.094), 32: (-0.007, -0.049, 0.098),
    36: (-0.044, -0.003, 0.078), 37: (-0.035, 0.003, 0.083), 38: (-0.026, 0.003, 0.085),
    39: (-0.018, -0.005, 0.083), 40: (-0.026, -0.009, 0.085), 41: (-0.035, -0.009, 0.083),
    48: (-0.024, -0.073, 0.088), 49: (-0.015, -0.067, 0.097), 50: (-0.006, -0.064, 0.101),
    59: (-0.015, -0.081, 0.095), 58: (-0.007, -0.085, 0.097),
    60: (-0.021, -0.073, 0.09), 61: (-0.008, -0.071, 0.098), 67: (-0.008, -0.076, 0.097),
}  # fmt: skip
_MIDDLE = {
    8: (-0.113, 0.085), 27: (0.0, 0.099), 28: (-0.013, 0.106), 29: (-0.026, 0.112),
    30: (-0.038, 0.118), 33: (-0.052, 0.1), 51: (-0.066, 0.102), 57: (-0.087, 0.098),
    62: (-0.071, 0.1), 66: (-0.077, 0.098),
}  # fmt: skip
_LEFT_OF = {
    **{k: 16 - k for k in range(8)}, **{17 + k: 26 - k for k in range(5)}, 31: 35, 32: 34,
    36: 45, 37: 44, 38: 43, 39: 42, 40: 47, 41: 46, 48: 54, 49: 53, 50: 52, 59: 55, 58: 56,
    60: 64, 61: 63, 67: 65,
}  # fmt: skip


def face() -> np.ndarray:
    """(68, 3) Multi-PIE landmarks of a symmetric face: +x its left, +y up, +z forward, metres."""
    points = np.full((68, 3), np.nan)
    for index, place in _RIGHT_HALF.items():
        points[index] = place
        points[_LEFT_OF[index]] = np.array(place) * (-1, 1, 1)
    for index, place in _MIDDLE.items():
        points[index] = (0, *place)
    return points


def motion(frames: int, fps: float, at=(0.0, 1.6, 0.0), turn: float = 0.3) -> np.ndarray:
    """(F, 4, 4) poses of a head that nods, turns and sways about a place."""
    t = np.arange(frames) / fps
    angles = np.stack([np.sin(2 * t), 1.6 * np.sin(1.3 * t + 1), 0.4 * np.cos(2 * t)], 1)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(turn * angles).as_matrix()
    poses[:, :3, 3] = np.stack([0.1 * np.sin(t), 0.02 * np.cos(3 * t), 0.1 * np.cos(t)], 1) + at
    return poses


def moved(poses: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(F, N, 3) points (N, 3) or (F, N, 3) at (F, 4, 4) poses."""
    return points @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]


def errors(poses: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """RMS degrees and millimetres by which poses differ from true ones beyond a fixed frame."""
    apart = np.linalg.inv(true) @ poses  # (F, 4, 4), all alike where there is no error
    turns = Rotation.from_matrix(apart[:, :3, :3])
    angles = (turns.mean().inv() * turns).magnitude()
    shifts = apart[:, :3, 3] - apart[:, :3, 3].mean(0)
    rms = [float(np.sqrt((a**2).mean())) for a in (angles, np.linalg.norm(shifts, axis=1))]
    return float(np.degrees(rms[0])), 1e3 * rms[1]
