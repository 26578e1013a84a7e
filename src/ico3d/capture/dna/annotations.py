"""Annotations of a DNA-Rendering recording about the body: SMPL-X parameters and keypoints."""

import logging
from dataclasses import dataclass

import numpy as np

from ico3d.capture.decoding import largest_channel
from ico3d.capture.smc.file import SmcFile

log = logging.getLogger(__name__)
JOINTS = 55
SHORT = ("betas", "expression")
"""Arrays that have too few rows in some published files."""


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


class BodyFits:
    """SMPL-X parameters of all frames.

    Some published files have one row of betas, or 40 rows of expressions for 225 frames. The last
    row is then used for all later frames, and a warning is logged once.
    """

    def __init__(self, file: SmcFile, num_frames: int, gender: str, world_from_fit: np.ndarray):
        """Reads the parameters, some hundred kilobytes.

        Args:
            file: File with annotations, which must have a group SMPLx.
            num_frames: Number of frames of the recording.
            gender: Gender of the SMPL-X model that was fitted.
            world_from_fit: (4, 4) rotation, see `SmplX`.

        Raises:
            CaptureError: If an array is damaged.
        """
        self._gender, self._world_from_fit = gender, world_from_fit
        parts = {name: file.numbers(f"SMPLx/{name}", (None, 10)) for name in SHORT}
        self._short = {
            name: np.zeros((1, 10)) if rows is None or not len(rows) else rows
            for name, rows in parts.items()
        }
        poses = file.numbers("SMPLx/fullpose", (None, JOINTS, 3))
        moves = file.numbers("SMPLx/transl", (None, 3))
        self._poses = np.zeros((0, JOINTS, 3)) if poses is None else poses
        self._moves = np.zeros((0, 3)) if moves is None else moves
        scale = file.numbers("SMPLx/scale", ())
        self._scale = 1.0 if scale is None else float(scale)
        self.faults = self._find_faults(num_frames)
        self._path, self._told = file.path, False

    def at(self, frame: int) -> SmplX | None:
        """The parameters of a frame, or None."""
        if self.faults and not self._told:
            self._told = True
            log.warning("%s: %s.", self._path, "; ".join(self.faults))
        if frame >= min(len(self._poses), len(self._moves)):
            return None
        betas, expression = (rows[min(frame, len(rows) - 1)] for rows in self._short.values())
        pose, move = self._poses[frame], self._moves[frame]
        return SmplX(betas, expression, pose, move, self._scale, self._gender, self._world_from_fit)

    def _find_faults(self, num_frames: int) -> list[str]:
        """Rows that are missing, one phrase for each part."""
        faults = [
            f"SMPL-X {name} have {len(rows)} rows for {num_frames} frames: the last one stands "
            "for all after it"
            for name, rows in self._short.items()
            if len(rows) < num_frames
        ]
        fitted = min(len(self._poses), len(self._moves))
        if fitted < num_frames:
            faults.append(f"only the first {fitted} of {num_frames} frames have a SMPL-X pose")
        return faults


def gender_of(value: object) -> str:
    """The variant of the body model for the root attribute `gender` of a file."""
    text = value.decode(errors="replace") if isinstance(value, bytes) else str(value)
    return text if text in ("male", "female") else "neutral"


def row(table: np.ndarray | None, frame: int) -> np.ndarray | None:
    """The row of a frame in a table with one row per frame; None if the table is too short."""
    return None if table is None or frame >= len(table) else table[frame]


def person(picture: np.ndarray) -> np.ndarray:
    """uint8 (H, W) from a mask picture: 255 where the largest channel exceeds half, else 0."""
    return np.where(largest_channel(picture) > 127, np.uint8(255), np.uint8(0))
