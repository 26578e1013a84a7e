"""The swinging arm with the skeleton that swings it."""

from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import from_rotvec
from ico3d.rig.rig import Rig
from support.bodies.moving_capture import FRAMES, MovingCapture


class TrackedCapture(MovingCapture):
    """The moving capture with a body track: a trunk, and an arm that hangs on the shoulder.

    Attributes:
        error: Degrees by which the track's shoulder is wrong, now this way, now the other.
        misplaced: Metres by which it lies too high at rest.
    """

    def __init__(self, path: Path, error: float = 0.0, misplaced: float = 0.0):
        super().__init__(path)
        self.error, self.misplaced = error, misplaced

    def body_track(self) -> BodyTrack:
        rest = self._rest
        hulls = [np.flatnonzero(part) for part in (~self.arm, self.arm)]
        faces = np.concatenate([outward(rest, part) for part in hulls])
        joints = np.zeros((len(rest), 4), np.uint8)
        joints[:, 0] = self.arm
        weights = np.zeros((len(rest), 4), np.float32)
        weights[:, 0] = 1
        turns = np.zeros((FRAMES, 2, 3))
        wrong = np.radians(self.error) * (-1.0) ** np.arange(FRAMES)
        turns[:, 1, 2] = [self.angle(f) + wrong[f] for f in range(FRAMES)]
        places = np.array([[0.0, 0, 0], [0.14, 0.2 + self.misplaced, 0]])
        return BodyTrack(
            Rig(("trunk", "shoulder"), (-1, 0), places),
            self.fps,
            from_rotvec(turns).astype(np.float32),
            np.zeros((FRAMES, 3), np.float32),
            np.ones(FRAMES, bool),
            rest.astype(np.float32),
            faces.astype(np.int32),
            Binding(joints, weights),
            "two ellipsoids",
        )


def outward(points: np.ndarray, part: np.ndarray) -> np.ndarray:
    """(T, 3) triangles of the convex hull of some points, counter-clockwise seen from outside."""
    hull = ConvexHull(points[part])
    faces = part[hull.simplices]
    corners = points[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (across * hull.equations[:, :3]).sum(1) < 0
    return np.where(inward[:, None], faces[:, ::-1], faces)
