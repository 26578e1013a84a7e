"""The file of a tracked head, `tracking.safetensors` (docs/captures/multiview.md)."""

import math
import os
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import save

from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.finding import Finding
from ico3d.common.expression import EYE_NAMES
from ico3d.common.files import MOST_NOTES, read_small, write_one_of_many
from ico3d.common.unpacking.heads import load_bounded
from ico3d.errors import CaptureError

NAME = "tracking.safetensors"


@dataclass(frozen=True)
class HeadTrack:
    """A tracked head through F frames of a recording by C cameras.

    Attributes:
        world_from_head: (F, 4, 4) float64 rigid head poses, metres.
        landmarks: (F, 68, 3) float32, Multi-PIE, in canonical head space, metres.
        eyes: (F, 7) float32 in the order of `EYE_NAMES`.
        blendshapes: (F, 52) float32, in the order of MediaPipe.
        views: (F, C) uint8, 1 where the camera's picture was used for the frame; frames without any
            are interpolated.
    """

    world_from_head: np.ndarray
    landmarks: np.ndarray
    eyes: np.ndarray
    blendshapes: np.ndarray
    views: np.ndarray

    @property
    def tracked(self) -> np.ndarray:
        """(F,) bool: frames that were measured, not interpolated."""
        return np.any(self.views, axis=1)

    @property
    def gaps(self) -> list[tuple[int, int]]:
        """First and last frame of each run of frames that were interpolated."""
        edges = np.flatnonzero(np.diff(np.concatenate([[1], self.tracked.astype(int), [1]])))
        return [(int(start), int(stop) - 1) for start, stop in edges.reshape(-1, 2)]

    def finding(self) -> Finding:
        """A finding for `ico3d capture check` about the interpolated frames."""
        found = self.gaps
        if not found:
            return Finding("head", "ok", f"tracked in all {len(self.views)} frames")
        longest = max(found, key=lambda gap: gap[1] - gap[0])
        text = (
            f"interpolated in {int((~self.tracked).sum())} of {len(self.views)} frames, "
            f"longest from {longest[0]} to {longest[1]}"
        )
        return Finding("head", "warn", text)

    def write(self, recording: Path) -> Path:
        """Writes the track of a recording, atomically.

        Args:
            recording: Path of the recording.

        Raises:
            CaptureError: If the recording's folder is not writable.
            StorageError: If the disk has no room for it and some more.
        """
        arrays = {f.name: np.ascontiguousarray(getattr(self, f.name)) for f in fields(self)}
        file = track_file(recording)
        try:
            write_one_of_many(file, save(arrays))
        except OSError as error:
            raise _unwritable(recording, error.strerror) from error
        return file


def check_writable(recording: Path) -> None:
    """Checks, before hours of tracking, that the track can be written.

    Raises:
        CaptureError: If the recording's folder is not writable.
    """
    if not os.access(track_file(recording).parent, os.W_OK):
        raise _unwritable(recording, "Read-only")


def _unwritable(recording: Path, why: str | None) -> CaptureError:
    return CaptureError(
        f"{track_file(recording)} cannot be written ({why}): a track lies with its recording; "
        f"make one of your own with ico3d capture resize {recording} OUT."
    )


def track_file(recording: Path) -> Path:
    """Path of a recording's track: in the recording's folder, or beside the recording's file."""
    return recording / NAME if os.path.isdir(recording) else recording.with_suffix(f".{NAME}")


def read_track(recording: Path, num_frames: int, num_cameras: int) -> HeadTrack | None:
    """Reads the track of a recording.

    Args:
        recording: The `path` of the capture.
        num_frames: Number of frames of the capture.
        num_cameras: Number of cameras of the capture.

    Returns:
        The track, or None if there is no file.

    Raises:
        CaptureError: If the file is damaged or belongs to another recording.
    """
    file = track_file(recording)
    if not os.path.isfile(file):
        return None
    mend = "delete it and run ico3d capture track again"
    shapes = {
        "world_from_head": (num_frames, 4, 4),
        "landmarks": (num_frames, 68, 3),
        "eyes": (num_frames, len(EYE_NAMES)),
        "blendshapes": (num_frames, len(BLENDSHAPES)),
        "views": (num_frames, num_cameras),
    }
    most = MOST_NOTES + 8 * sum(map(math.prod, shapes.values()))
    try:
        arrays = load_bounded(read_small(file, most=most))
    except (OSError, SafetensorError, ValueError, KeyError) as error:
        raise CaptureError(f"{file} is damaged: {mend}.") from error
    for name, shape in shapes.items():
        array = arrays.get(name)
        if array is None or array.shape != shape:
            found = "nothing" if array is None else f"{array.shape}"
            raise CaptureError(f"{file}: '{name}' must be {shape}, found {found}: {mend}.")
        if array.dtype.kind not in "fiu":
            raise CaptureError(f"{file}: '{name}' holds no real numbers: {mend}.")
        if not np.isfinite(array).all():
            raise CaptureError(f"{file}: '{name}' holds NaN or infinity: {mend}.")
    return HeadTrack(**{name: arrays[name] for name in shapes})
