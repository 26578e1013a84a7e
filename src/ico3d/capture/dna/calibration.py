"""Cameras of a DNA-Rendering recording: positions, lenses and colour correction."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.smc.cameras import SmcCamera, picture_size, read_camera
from ico3d.capture.smc.file import SmcFile
from ico3d.errors import CaptureError

GROUPS = ("Camera_5mp", "Camera_12mp")


@dataclass(frozen=True)
class Device(SmcCamera):
    """A camera as the files describe it.

    Attributes:
        number: Number of the camera in the files, 0 to 59.
        colours: (256, 3) uint8 corrected value for each recorded value of red, green and blue.
    """

    number: int
    colours: np.ndarray


def read_devices(main: SmcFile, annotations: SmcFile) -> tuple[list[Device], list[str]]:
    """All cameras that have pictures and a calibration, in order of their numbers.

    Returns:
        The cameras, and the names of those that have pictures but no calibration.

    Raises:
        CaptureError: If there is no such camera, or a calibration is damaged.
    """
    devices, lost = [], []
    for group in GROUPS:
        size = None
        for number in main.numbered(group):
            if not annotations.keys(f"Camera_Parameter/{number:02d}"):
                lost.append(f"{number:02d}")
                continue
            size = size or picture_size(main, f"{group}/{number}/color")
            if size is not None:
                devices.append(_device(annotations, group, number, size))
    if not devices:
        raise CaptureError(
            f"{main.path} has no camera with pictures and a calibration: "
            "is it the main file of a DNA-Rendering recording?"
        )
    return devices, lost


def _device(annotations: SmcFile, group: str, number: int, size: tuple[int, int]) -> Device:
    """What the files say of one camera of a device."""
    inside, name = f"Camera_Parameter/{number:02d}", f"{number:02d}"
    camera = read_camera(annotations, inside, name, size, f"{group}/{number}/color")
    polynomial = annotations.numbers(f"{inside}/Color_Calibration", (3, 3))
    return Device(camera.lens, camera.camera_to_world, camera.pictures, number, colours(polynomial))


def colours(polynomial: np.ndarray | None) -> np.ndarray:
    """The colour correction as a table.

    Args:
        polynomial: (3, 3) rows (a, b, c) for blue, green and red: x' = a x² + b x + c, x in 0 to
            255; None for no correction.

    Returns:
        (256, 3) uint8, columns red, green and blue.
    """
    value = np.arange(256.0)
    if polynomial is None:
        return np.repeat(value[:, None], 3, 1).astype(np.uint8)
    a, b, c = polynomial[::-1].T[:, None]  # (1, 3) each, now red first
    corrected = a * value[:, None] ** 2 + b * value[:, None] + c  # (256, 3)
    return np.clip(np.rint(corrected), 0, 255).astype(np.uint8)
