"""SMPL-X parameters of a person, as a recording brings them."""

from dataclasses import dataclass

import numpy as np

JOINTS = 55
"""Number of joints of SMPL-X."""


@dataclass(frozen=True)
class SmplX:
    """SMPL-X parameters of one frame; the SMPL-X model itself is not part of ico3d.

    Vertices that SMPL-X computes from these with `flat_hand_mean=False, use_pca=False` lie in the
    world of the files; `world_from_fit` takes them to the capture's world.

    Attributes:
        betas: (10,) shape parameters.
        expression: (10,) expression parameters of the face.
        fullpose: (55, 3) axis-angle rotations of all joints, radians.
        transl: (3,) translation, metres.
        scale: Scale of the body, as stated by the fit.
        gender: Variant of the body model: "male", "female" or "neutral".
        world_from_fit: (4, 4) rotation from the world of the files to the capture's world.
    """

    betas: np.ndarray
    expression: np.ndarray
    fullpose: np.ndarray
    transl: np.ndarray
    scale: float
    gender: str
    world_from_fit: np.ndarray

    @property
    def global_orient(self) -> np.ndarray:
        """(3,) axis-angle rotation of the whole body."""
        return self.fullpose[0]

    @property
    def body_pose(self) -> np.ndarray:
        """(21, 3) axis-angle rotations of joints 1 to 21."""
        return self.fullpose[1:22]

    @property
    def jaw_pose(self) -> np.ndarray:
        """(3,) axis-angle rotation of the jaw."""
        return self.fullpose[22]

    @property
    def eye_poses(self) -> np.ndarray:
        """(2, 3) axis-angle rotations of the left and the right eye."""
        return self.fullpose[23:25]

    @property
    def left_hand_pose(self) -> np.ndarray:
        """(15, 3) axis-angle rotations of the left hand's joints."""
        return self.fullpose[25:40]

    @property
    def right_hand_pose(self) -> np.ndarray:
        """(15, 3) axis-angle rotations of the right hand's joints."""
        return self.fullpose[40:55]
