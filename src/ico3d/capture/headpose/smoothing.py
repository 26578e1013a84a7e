"""Values and poses over time: gaps filled, noise taken out without delay.

The filter is Savitzky and Golay's: at each frame, a parabola through the frames around it. Looking
as far ahead as back it has no lag; a parabola follows the turning points of a nod, which a moving
average would flatten. Its window is a time, so that captures of all frame rates are treated alike.
"""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

WINDOW = 0.3
"""Seconds that a pose is fitted over; heads do not shake within less."""
DEGREE = 2
LEAST, MOST = 5, 15
"""Frames of the window, whatever the frame rate."""


def window_of(fps: float, num_frames: int) -> int:
    """Odd number of frames of the window; 1 where a capture is too short to smooth."""
    count = 2 * round(WINDOW * fps / 2) + 1
    count = min(max(count, LEAST), MOST)
    return count if num_frames >= count else (LEAST if num_frames >= LEAST else 1)


def filled(values: np.ndarray, frames: np.ndarray, num_frames: int) -> np.ndarray:
    """Values of all frames: linear between those known, constant before and after them.

    Args:
        values: (K, ...) at the frames known.
        frames: (K,) ascending frame numbers.
        num_frames: How many frames the clip has.

    Returns:
        (num_frames, ...).
    """
    flat = values.reshape(len(frames), -1)
    columns = [np.interp(np.arange(num_frames), frames, column) for column in flat.T]
    return np.stack(columns, 1).reshape(num_frames, *values.shape[1:])


def filled_poses(poses: np.ndarray, frames: np.ndarray, num_frames: int) -> np.ndarray:
    """(num_frames, 4, 4) from (K, 4, 4): the turn goes along the shortest arc, the place straight.

    Args:
        poses: Rigid, at the frames known.
        frames: (K,) ascending frame numbers.
        num_frames: How many frames the clip has.
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

    Turns are fitted as rotation vectors about the frame's own turn, so that a person may turn all
    the way round.
    """
    count = len(poses)
    window = window_of(fps, count)
    if window == 1:
        return poses
    from scipy.signal import savgol_coeffs  # takes long to import

    smooth = poses.copy()
    for frame in range(count):
        first = min(max(frame - window // 2, 0), count - window)
        part = poses[first : first + window]
        shares = savgol_coeffs(window, DEGREE, pos=frame - first, use="dot")  # (window,)
        own = Rotation.from_matrix(poses[frame, :3, :3])
        around = (own.inv() * Rotation.from_matrix(part[:, :3, :3])).as_rotvec()  # (window, 3)
        smooth[frame, :3, :3] = (own * Rotation.from_rotvec(shares @ around)).as_matrix()
        smooth[frame, :3, 3] = shares @ part[:, :3, 3]
    return smooth
