"""Annotations of a DNA-Rendering recording about the body: SMPL-X parameters and keypoints."""

import logging

import numpy as np

from ico3d.capture.decoding import largest_channel
from ico3d.capture.smc.file import SmcFile
from ico3d.capture.smplx import JOINTS, SmplX

log = logging.getLogger(__name__)
SHORT = ("betas", "expression")
"""Arrays that have too few rows in some published files."""


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
