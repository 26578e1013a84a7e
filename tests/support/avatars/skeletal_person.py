"""The planted person with a skeleton: the head turns about its joint, and all else stands still."""

import numpy as np
from scipy.spatial.transform import Rotation

from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.rig import Rig
from support.avatars.planted_person import AXES, FRAMES, PlantedPerson
from support.bodies.tracked_capture import outward
from support.rigs import rig_of

HEAD_HEIGHT = 1.58
"""Metres of the head's middle in a person of 1.7 m; in the studio it is at 0."""
PARTS = {  # joint: half axes and middle of an ellipsoid
    "spine2": ((0.2, 0.25, 0.12), (0.0, -0.42, -0.02)),
    "neck": ((0.05, 0.13, 0.05), (0.0, -0.15, -0.02)),
    "head": (tuple(AXES), (0.0, 0.0, 0.0)),
}


def skeleton() -> Rig:
    """Named as SMPL-X does, its head where the planted person's is."""
    rig = rig_of("SMPL-X")
    return Rig(rig.names, rig.parents, rig.joints - np.array([0.0, HEAD_HEIGHT, 0.0]))


class SkeletalPerson(PlantedPerson):
    """Has a body track whose head joint is turned wrongly by an angle, in all frames alike.

    Attributes:
        wrong: Degrees.
    """

    kind = "planted person on a skeleton"
    wrong = 4.0

    def true_world_from_head(self, frame) -> np.ndarray:
        """(4, 4) about the head's joint."""
        turn, joint = self.nod(frame).as_matrix(), skeleton().joints[skeleton().index("head")]
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn, joint - turn @ joint
        return pose

    @staticmethod
    def nod(frame) -> Rotation:
        """How the head is turned in a frame."""
        return Rotation.from_euler("xyz", (6 * np.sin(frame), 14 * np.cos(frame), 0), degrees=True)

    def body_track(self) -> BodyTrack:
        rig, rng = skeleton(), np.random.default_rng(5)
        turns = np.tile([1.0, 0, 0, 0], (FRAMES, len(rig), 1))
        wrong = Rotation.from_euler("y", self.wrong, degrees=True)
        for frame in range(FRAMES):
            quat = (self.nod(frame) * wrong).as_quat(scalar_first=True)
            turns[frame, rig.index("head")] = quat
        points, faces, joints = [], [], []
        for name, (axes, middle) in PARTS.items():
            ball = rng.normal(size=(150, 3))
            ball /= np.linalg.norm(ball, axis=1, keepdims=True)
            part = 150 * len(points) + np.arange(150)
            points.append(ball * axes + middle)
            joints.append(np.tile([rig.index(name), 0, 0, 0], (150, 1)))
            faces.append(part[0] + outward(points[-1], np.arange(150)))
        weights = np.tile([1.0, 0, 0, 0], (150 * len(PARTS), 1))
        return BodyTrack(
            rig,
            self.fps,
            turns.astype(np.float32),
            np.zeros((FRAMES, 3), np.float32),
            np.ones(FRAMES, bool),
            np.concatenate(points).astype(np.float32),
            np.concatenate(faces).astype(np.int32),
            Binding(np.concatenate(joints).astype(np.uint8), weights.astype(np.float32)),
            "three ellipsoids",
        )
