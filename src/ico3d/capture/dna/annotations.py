"""What the annotations of a DNA-Rendering recording say about the body: SMPL-X and keypoints."""

import logging
from dataclasses import dataclass

import numpy as np

from ico3d.capture.decoding import largest_channel
from ico3d.capture.smc.file import SmcFile

log = logging.getLogger(__name__)
JOINTS = 55
SHORT = ("betas", "expression")
"""Parts of which published files lack rows."""


@dataclass(frozen=True)
class SmplX:
    """The SMPL-X body fitted to one frame; the body model itself is not part of ico3d.

    Its vertices, computed with `flat_hand_mean=False, use_pca=False`, lie in the world of the
    files: world_from_fit takes them to the capture's world.

    Attributes:
        betas: (10,) shape.
        expression: (10,) of the face.
        fullpose: (55, 3) axis-angles of all joints.
        transl: (3,) metres.
        scale: Of the body, as the fit states it.
        gender: "male", "female" or "neutral": which body model was fitted.
        world_from_fit: (4, 4) rotation.
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
        """(3,) the whole body."""
        return self.fullpose[0]

    @property
    def body_pose(self) -> np.ndarray:
        """(21, 3) joints 1 to 21."""
        return self.fullpose[1:22]

    @property
    def jaw_pose(self) -> np.ndarray:
        """(3,)."""
        return self.fullpose[22]

    @property
    def eye_poses(self) -> np.ndarray:
        """(2, 3) left, right."""
        return self.fullpose[23:25]

    @property
    def left_hand_pose(self) -> np.ndarray:
        """(15, 3)."""
        return self.fullpose[25:40]

    @property
    def right_hand_pose(self) -> np.ndarray:
        """(15, 3)."""
        return self.fullpose[40:55]


class BodyFits:
    """The SMPL-X parameters of all frames.

    Some published files have one row of betas, or 40 rows of expressions for 225 frames. Their
    last row then stands for the frames after it, which is said once.
    """

    def __init__(self, file: SmcFile, num_frames: int, gender: str, world_from_fit: np.ndarray):
        """Reads the parameters, some hundred kilobytes.

        Args:
            file: The annotations; they must have a group SMPLx.
            num_frames: Frames of the recording.
            gender: Gender of the SMPL-X model that was fitted.
            world_from_fit: (4, 4), see `SmplX`.

        Raises:
            CaptureError: If a part is damaged.
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
        """The fit of a frame, or None where there is none."""
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
    """The body model that belongs to the root attribute `gender`."""
    text = value.decode(errors="replace") if isinstance(value, bytes) else str(value)
    return text if text in ("male", "female") else "neutral"


def row(table: np.ndarray | None, frame: int) -> np.ndarray | None:
    """A frame's row of a table with a row per frame, or None where it has none."""
    return None if table is None or frame >= len(table) else table[frame]


def person(picture: np.ndarray) -> np.ndarray:
    """uint8 (H, W) of a mask picture: 255 where its largest channel is above the middle."""
    return np.where(largest_channel(picture) > 127, np.uint8(255), np.uint8(0))
