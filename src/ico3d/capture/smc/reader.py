"""The common part of the readers of SMC files."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from ico3d.capture.capture import RecordedCapture
from ico3d.capture.decoding import decoded
from ico3d.capture.finding import Finding, missing_and_damaged
from ico3d.capture.headpose.from_landmarks import HeadMotion, head_from_landmarks
from ico3d.capture.poses import nearest_axis, turn_upright, turned, up_of_cameras
from ico3d.capture.smc.cameras import SmcCamera
from ico3d.capture.smc.file import MOST_ROWS, SmcFile
from ico3d.capture.vetting.claims import check_claimed
from ico3d.common.camera import Camera
from ico3d.errors import CaptureError

MAGICS = (b"\xff\xd8\xff", b"\x89PNG")


class SmcCapture(RecordedCapture):
    """A recording in SMC files.

    The world of the files is turned by multiples of 90° so that +y is up.
    """

    def __init__(self, path: Path, devices: Sequence[SmcCamera], num_frames: int):
        """Turns the cameras so that +y is up.

        Args:
            path: The recording's main file.
            devices: The recording's cameras.
            num_frames: Number of frames of the recording.
        """
        self.path, self.num_frames = path, num_frames
        up = up_of_cameras([device.camera_to_world for device in devices])
        self.upright: np.ndarray = turn_upright(nearest_axis(up))
        self.cameras = tuple(self._straight_camera(device) for device in devices)

    def face_points(self) -> np.ndarray | None:
        """(F, 68, 3) landmarks in the world, metres; NaN where not seen; None if there are none."""
        return None

    @cached_property
    def head_motion(self) -> HeadMotion | None:
        """Motion of the head from 3D landmarks; None if there are too few."""
        points = self.face_points()
        return None if points is None else head_from_landmarks(points)

    def world_from_head(self, frame: int) -> np.ndarray | None:
        """Head pose W_i (4, 4); None if the face was not found."""
        index = self.index(frame)
        return None if self.head_motion is None else self.head_motion.pose(index)

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) projected 3D landmarks in pixels; None if the face was not found."""
        index = self.index(frame)
        points = None if self.head_motion is None else self.head_motion.landmarks(index)
        return None if points is None else self.cameras[camera].project(points)[0]

    def landmarks_3d(self, frame: int) -> np.ndarray | None:
        """(68, 3) in canonical head space, metres; None where the face was not found.

        Landmarks that are missing in a frame are taken from the mean face.
        """
        pose = self.world_from_head(frame)
        points = None if self.head_motion is None else self.head_motion.landmarks(frame)
        if pose is None or points is None:
            return None
        return (points - pose[:3, 3]) @ pose[:3, :3]

    def index(self, frame: int) -> int:
        """Returns the number of an existing frame.

        Raises:
            CaptureError: If there is no such frame.
        """
        if not 0 <= frame < self.num_frames:
            raise CaptureError(f"{self.path} has frames 0 to {self.num_frames - 1}, not {frame}.")
        return frame

    def decoded(self, file: SmcFile, device: SmcCamera, inside: str) -> np.ndarray | None:
        """A picture as recorded, uint8 RGB (H, W, 3); None if missing.

        Raises:
            CaptureError: If the picture is damaged or has another size than the camera.
        """
        held = file.encoded(inside)
        if held is None:
            return None
        frame = inside.rpartition("/")[2]
        what = f"{file.path}: camera {device.name}, frame {frame} ({inside})"
        picture = decoded(held, what)[..., :3]
        height, width = picture.shape[:2]
        if (width, height) != (device.lens.width, device.lens.height):
            raise CaptureError(
                f"{what} has {width}x{height} pixels; the first of its kind "
                f"{device.lens.width}x{device.lens.height}."
            )
        return picture

    def _straight_camera(self, device: SmcCamera) -> Camera:
        """The pinhole camera of the straightened pictures."""
        inverse = np.linalg.inv(turned(self.upright, device.camera_to_world))
        lens = device.lens
        return Camera(lens.width, lens.height, lens.straight_intrinsics, inverse, device.name)


def count_frames(file: SmcFile, groups: Sequence[str], pictures: Sequence[str]) -> int:
    """Number of frames that a file announces, or else that the first camera has.

    Args:
        file: The file with the pictures.
        groups: Groups whose attribute `num_frame` announces a number.
        pictures: Path of the group with each camera's pictures.

    Raises:
        CaptureError: If the announced number is damaged, or there are far fewer pictures.
    """
    announced = [file.attribute(group, "num_frame") for group in groups]
    try:
        counts = [int(np.asarray(value).reshape(())) for value in announced if value is not None]
    except (TypeError, ValueError) as error:
        raise CaptureError(f"{file.path}: num_frame is damaged: fetch it again.") from error
    count = max(counts) if counts else len(file.keys(pictures[0]))
    if not 1 <= count <= MOST_ROWS:
        raise CaptureError(f"{file.path} announces {count} frames: fetch it again.")
    check_claimed(count, (len(file.keys(folder)) for folder in pictures), str(file.path))
    return count


def examine_views(what: str, file: SmcFile, folders: Mapping[str, str], num_frames: int) -> Finding:
    """Checks that every camera has every frame, and that files begin like pictures.

    Args:
        what: Name of the pictures in the report.
        file: The file with the pictures.
        folders: Path of the group with each camera's pictures, by name of the camera.
        num_frames: Number of frames that each camera should have.
    """
    missing, damaged = [], []
    for name, folder in folders.items():
        there = set(file.keys(folder))
        for frame in range(num_frames):
            if str(frame) not in there:
                missing.append((name, frame))
            elif not file.head(f"{folder}/{frame}", 4).startswith(MAGICS):
                damaged.append((name, frame))
    return missing_and_damaged(what, len(folders) * num_frames, missing, damaged)
