"""Head poses from the 68 landmarks of a face in 3D."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.headpose.procrustes import procrustes
from ico3d.capture.headpose.shape import inverse, moved
from ico3d.capture.headpose.whittaker import smoothed_poses

LANDMARKS = 68
HOLDING = np.ones(LANDMARKS, bool)
HOLDING[4:13] = False
HOLDING[48:] = False
"""(68,) bool: landmarks that may define the head's pose: all but those of jaw and lips."""
EYE_CORNERS = (36, 45)
"""Landmarks of the outer corners of the eyes, the person's right first."""
BRIDGE, SUBNASAL = 27, 33
BEHIND = 0.07
"""Distance in metres of the origin behind the line through the outer corners of the eyes."""


@dataclass(frozen=True)
class HeadMotion:
    """The motion of a head through F frames.

    Canonical head space: origin in the head between the eyes, +x to the person's left, +y up along
    the nose, +z forward, metres.

    Attributes:
        world_from_head: (F, 4, 4) head poses; NaN where the head was not found.
        face: (68, 3) mean landmarks in canonical head space, metres; NaN for landmarks never seen.
        points: (F, 68, 3) landmarks in the world, metres; unseen ones are those of the mean face;
            NaN where the head was not found.
    """

    world_from_head: np.ndarray
    face: np.ndarray
    points: np.ndarray

    def pose(self, frame: int) -> np.ndarray | None:
        """The head pose (4, 4) of a frame, or None if the head was not found."""
        pose = self.world_from_head[frame]
        return pose if np.isfinite(pose).all() else None

    def landmarks(self, frame: int) -> np.ndarray | None:
        """(68, 3) landmarks of a frame in the world, metres; None if some are unknown."""
        points = self.points[frame]
        return points if np.isfinite(points).all() else None


def head_from_landmarks(points: np.ndarray) -> HeadMotion | None:
    """Fits a rigid head to the landmarks of a face.

    Generalised Procrustes analysis over all frames uses landmarks that hardly move with the
    expression, weighted by their steadiness. The poses are then smoothed as far as their noise
    requires.

    Args:
        points: (F, 68, 3) Multi-PIE landmarks in the world, metres; NaN where not seen.

    Returns:
        The motion, or None if no frame has enough landmarks.
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
    """The transform (4, 4) from canonical head space to that of a face's landmarks (68, 3)."""
    right, left = face[list(EYE_CORNERS)]
    across = (left - right) / np.linalg.norm(left - right)
    up = face[BRIDGE] - face[SUBNASAL]
    up -= across * (up @ across)
    up /= np.linalg.norm(up)
    frame = np.eye(4)
    frame[:3, :3] = np.stack([across, up, np.cross(across, up)], 1)
    frame[:3, 3] = (left + right) / 2 - BEHIND * frame[:3, 2]
    return frame
