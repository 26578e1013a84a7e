"""Fills gaps in values and poses over time, and removes noise without delay.

The filter is that of Savitzky and Golay: at each frame a parabola is fitted to the neighbouring
frames. It looks as far ahead as back and therefore has no delay. A parabola follows the turning
points of a nod, which a moving average would flatten. The window is defined in seconds, so that all
frame rates are treated alike.
"""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from ico3d.common.savitzky_golay import shares_of

WINDOW = 0.3
"""Window of the filter for poses in seconds; heads do not shake faster."""
DEGREE = 2
LEAST, MOST = 5, 15
"""Limits of the window in frames."""


def window_of(fps: float, num_frames: int) -> int:
    """Size of the window in frames, odd; 1 for captures that are too short."""
    count = 2 * round(WINDOW * fps / 2) + 1
    count = min(max(count, LEAST), MOST)
    return count if num_frames >= count else (LEAST if num_frames >= LEAST else 1)


def filled(values: np.ndarray, frames: np.ndarray, num_frames: int) -> np.ndarray:
    """Values of all frames: linear between known ones, constant before and after.

    Args:
        values: (K, ...) values at the known frames.
        frames: (K,) ascending frame numbers.
        num_frames: Number of frames of the clip.

    Returns:
        (num_frames, ...).
    """
    flat = values.reshape(len(frames), -1)
    columns = [np.interp(np.arange(num_frames), frames, column) for column in flat.T]
    return np.stack(columns, 1).reshape(num_frames, *values.shape[1:])


def filled_poses(poses: np.ndarray, frames: np.ndarray, num_frames: int) -> np.ndarray:
    """(num_frames, 4, 4): rotations along the shortest arc, positions along straight lines.

    Args:
        poses: (K, 4, 4) rigid poses at the known frames.
        frames: (K,) ascending frame numbers.
        num_frames: Number of frames of the clip.
    """
    every = np.tile(np.eye(4), (num_frames, 1, 1))
    every[:, :3, 3] = filled(poses[:, :3, 3], frames, num_frames)
    turns = Rotation.from_matrix(poses[:, :3, :3])
    if len(frames) == 1:
        every[:, :3, :3] = turns.as_matrix()[0]
    else:
        times = np.clip(np.arange(num_frames), frames[0], frames[-1])
        every[:, :3, :3] = Slerp(frames, turns)(times).as_matrix()
    return every


def smoothed_poses(poses: np.ndarray, fps: float) -> np.ndarray:
    """Rigid poses (F, 4, 4) without the jitter of single frames.

    Rotations are fitted as rotation vectors relative to each frame's own rotation, so that a person
    may turn all the way round.
    """
    count = len(poses)
    window = window_of(fps, count)
    if window == 1:
        return poses
    smooth = poses.copy()
    for frame in range(count):
        first = min(max(frame - window // 2, 0), count - window)
        part = poses[first : first + window]
        shares = shares_of(window, frame - first, DEGREE)
        own = Rotation.from_matrix(poses[frame, :3, :3])
        around = (own.inv() * Rotation.from_matrix(part[:, :3, :3])).as_rotvec()  # (window, 3)
        smooth[frame, :3, :3] = (own * Rotation.from_rotvec(shares @ around)).as_matrix()
        smooth[frame, :3, 3] = shares @ part[:, :3, 3]
    return smooth
