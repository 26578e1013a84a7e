"""Cameras and frame rate of a RenderMe-360 recording."""

from collections.abc import Sequence

from ico3d.capture.smc.cameras import SmcCamera, picture_size, read_camera
from ico3d.capture.smc.file import SmcFile
from ico3d.errors import CaptureError

FPS, MANY_FPS = 30.0, 15.0
"""Usual frame rate, and that of speech recorded by many cameras: every other frame is kept."""
MANY = 38
"""Number of cameras with pictures from which on a speech recording has the rate `MANY_FPS`."""


def read_cameras(raw: SmcFile, calibration: SmcFile) -> tuple[list[SmcCamera], list[str]]:
    """All cameras that have pictures and a calibration, in order of their numbers.

    Returns:
        The cameras, and the names of those that have pictures but no calibration.

    Raises:
        CaptureError: If there is no such camera, or a calibration is damaged.
    """
    cameras, lost = [], []
    for name in sorted(key for key in raw.keys("Camera") if key.isdecimal()):
        pictures = f"Camera/{name}/color"
        size = picture_size(raw, pictures)
        if size is None:
            continue  # parts with speech list cameras that took no part
        if calibration.keys(f"Calibration/{name}"):
            inside = f"Calibration/{name}"
            cameras.append(read_camera(calibration, inside, name, size, pictures))
        else:
            lost.append(name)
    if not cameras:
        raise CaptureError(
            f"{raw.path} has no camera with pictures and a calibration: "
            "is it the raw file of a RenderMe-360 recording?"
        )
    return cameras, lost


def frame_rate(
    part: str, cameras: Sequence[SmcCamera], num_frames: int, seconds: float | None
) -> float:
    """Frames per second, which the files do not state.

    Args:
        part: Name of the performed part, see `Files.part`.
        cameras: The cameras that have pictures.
        num_frames: Number of frames of each camera.
        seconds: Duration of the sound, which decides the rate; None without sound.
    """
    if seconds:
        measured = num_frames / seconds
        return FPS if measured * measured > FPS * MANY_FPS else MANY_FPS
    return MANY_FPS if part.startswith("s") and len(cameras) == MANY else FPS
