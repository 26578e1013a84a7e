"""Cameras of recordings in SMC files: poses and lenses."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.decoding import size_of
from ico3d.capture.lens import Lens
from ico3d.capture.poses import rigid
from ico3d.capture.smc.file import SmcFile
from ico3d.errors import CaptureError


@dataclass(frozen=True)
class SmcCamera:
    """A camera as the files describe it.

    Attributes:
        lens: Name, size, intrinsics and distortion of its recorded pictures.
        camera_to_world: (4, 4) pose in the world of the files, metres.
        pictures: Path of the group with the camera's pictures in their file.
    """

    lens: Lens
    camera_to_world: np.ndarray
    pictures: str

    @property
    def name(self) -> str:
        """Name of the camera: two digits."""
        return self.lens.name


def read_camera(
    file: SmcFile, inside: str, name: str, size: tuple[int, int], pictures: str
) -> SmcCamera:
    """Reads a camera from K (3, 3), D (5,) and RT (4, 4), which is camera to world.

    Args:
        file: The file with the calibration.
        inside: Path of the camera's group in the file.
        name: Name of the camera: two digits.
        size: Width and height of the camera's pictures in pixels.
        pictures: Path of the group with the camera's pictures.

    Raises:
        CaptureError: If an array is missing or damaged.
    """

    def read(part: str, shape: tuple[int, ...]) -> np.ndarray:
        values = file.numbers(f"{inside}/{part}", shape)
        if values is None:
            raise CaptureError(f"{file.path}: camera {name} has no {part}.")
        return values

    intrinsics = read("K", (3, 3))
    intrinsics[:2, 2] += 0.5  # calibrated with OpenCV, which counts from pixel centres
    lens = Lens(name, *size, intrinsics, tuple(read("D", (5,)).tolist()))
    return SmcCamera(lens, rigid(read("RT", (4, 4)), f"camera {name}"), pictures)


def picture_size(file: SmcFile, pictures: str) -> tuple[int, int] | None:
    """Width and height in pixels of the first picture in a group; None for an empty group."""
    for frame in file.keys(pictures)[:1]:
        where = f"{pictures}/{frame}"
        return size_of(file.encoded(where) or b"", f"{file.path}: {where}")
    return None
