"""Head poses from the 68 landmarks of a face in space."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.headpose.procrustes import procrustes
from ico3d.capture.headpose.shape import inverse, moved
from ico3d.capture.headpose.whittaker import smoothed_poses

LANDMARKS = 68
HOLDING = np.ones(LANDMARKS, bool)
HOLDING[4:13] = False
HOLDING[48:] = False
"""Landmarks that may hold the head: all but those of the jaw and the lips."""
EYE_CORNERS = (36, 45)
"""The outer ones, the person's right first."""
BRIDGE, SUBNASAL = 27, 33
BEHIND = 0.07
"""Metres from the line of the outer eye corners back to the origin."""


@dataclass(frozen=True)
class HeadMotion:
    """Where a head was.

    Canonical head space: origin in the head between the eyes, +x to the person's left, +y up the
    nose, +z forward, metres.

    Attributes:
        world_from_head: (F, 4, 4); NaN where the head was not found.
        face: (68, 3) mean landmarks in canonical head space; NaN for those never seen.
        points: (F, 68, 3) landmarks of each frame in the world; those that were not seen are the
            mean face's; NaN where the head was not found.
    """

    world_from_head: np.ndarray
    face: np.ndarray
    points: np.ndarray

    def pose(self, frame: int) -> np.ndarray | None:
        """(4, 4) world from head, or None where the head was not found."""
        pose = self.world_from_head[frame]
        return pose if np.isfinite(pose).all() else None

    def landmarks(self, frame: int) -> np.ndarray | None:
        """(68, 3) in the world, or None where not all are known."""
        points = self.points[frame]
        return points if np.isfinite(points).all() else None


def head_from_landmarks(points: np.ndarray) -> HeadMotion | None:
    """Fits a rigid head to the landmarks of a face.

    Generalised Procrustes analysis over all frames, by landmarks that the expression moves little,
    each counting by how little it strays; smoothed over time as much as their noise asks for.

    Args:
        points: (F, 68, 3) Multi-PIE landmarks in the world, metres; NaN where not seen.

    Returns:
        The track, or None where no frame shows enough.
    """
    motion = procrustes(points, HOLDING)
    needed = motion.shape[[*EYE_CORNERS, BRIDGE, SUBNASAL]]
    if not np.isfinite(motion.poses).any() or not np.isfinite(needed).all():
        return None
    motion = motion.in_frame(head_frame(motion.shape))
    poses = smoothed_poses(motion)
    local = moved(inverse(poses), points)  # (F, 68, 3)
    filled = moved(poses, np.where(np.isfinite(local), local, motion.shape))
    return HeadMotion(poses, motion.shape, filled)


def head_frame(face: np.ndarray) -> np.ndarray:
    """(4, 4) canonical head space in the coordinates of (68, 3) landmarks of a face."""
    right, left = face[list(EYE_CORNERS)]
    across = (left - right) / np.linalg.norm(left - right)
    up = face[BRIDGE] - face[SUBNASAL]
    up -= across * (up @ across)
    up /= np.linalg.norm(up)
    frame = np.eye(4)
    frame[:3, :3] = np.stack([across, up, np.cross(across, up)], 1)
    frame[:3, 3] = (left + right) / 2 - BEHIND * frame[:3, 2]
    return frame
