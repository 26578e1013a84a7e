"""Cameras of recordings in SMC files: where they stand and their lenses."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.decoding import size_of
from ico3d.capture.lens import Lens
from ico3d.capture.poses import rigid
from ico3d.capture.smc.file import SmcFile
from ico3d.errors import CaptureError


@dataclass(frozen=True)
class SmcCamera:
    """One camera as the files describe it.

    Attributes:
        lens: Name, size, intrinsics and distortion of its recorded pictures.
        camera_to_world: (4, 4) in the world of the files.
        pictures: The group of its pictures in the file that holds them.
    """

    lens: Lens
    camera_to_world: np.ndarray
    pictures: str

    @property
    def name(self) -> str:
        """Two digits."""
        return self.lens.name


def read_camera(
    file: SmcFile, inside: str, name: str, size: tuple[int, int], pictures: str
) -> SmcCamera:
    """A camera from K (3, 3), D (5,) and RT (4, 4), camera to world.

    Args:
        file: The file with the calibration.
        inside: The camera's group in it.
        name: Two digits.
        size: Width and height of its pictures.
        pictures: The group of its pictures.

    Raises:
        CaptureError: If a part is missing or damaged.
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
    """Width and height of the first picture in a group, or None where it has none."""
    for frame in file.keys(pictures)[:1]:
        where = f"{pictures}/{frame}"
        return size_of(file.encoded(where) or b"", f"{file.path}: {where}")
    return None
