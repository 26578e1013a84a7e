"""Computes masks of a multiview folder from the clean plates."""

import io
import logging
from pathlib import Path

import numpy as np
from PIL import Image

from ico3d.capture.multiview.cutout import matte
from ico3d.capture.multiview.parallel import View, each_camera
from ico3d.capture.multiview.reader import MultiviewCapture
from ico3d.common.files import resolved, write_one_of_many
from ico3d.errors import CaptureError

log = logging.getLogger(__name__)


def make_masks(folder: Path, workers: int) -> int:
    """Writes the missing masks; existing ones are kept.

    Args:
        folder: A multiview folder with `backgrounds/`.
        workers: Number of threads.

    Returns:
        The number of masks written.

    Raises:
        CaptureError: If the folder has no clean plate, a picture is damaged, or masks would be
            written somewhere else, where links lead.
    """
    capture = MultiviewCapture(folder)
    for lens in capture.lenses:
        place = folder / "masks" / lens.name
        if not resolved(place).is_relative_to(resolved(folder)):
            raise CaptureError(f"{place} leads out of the recording: put a folder there instead.")
    plates = [capture.files.plate(camera) is not None for camera in range(len(capture.cameras))]
    if not any(plates):
        raise CaptureError(
            f"{folder} has no clean plates: put a picture without the person into "
            "backgrounds/CAMERA.png for each camera."
        )
    for lens, there in zip(capture.lenses, plates, strict=True):
        if not there:
            log.warning("%s: camera %s has no clean plate and gets no masks.", folder, lens.name)
    cameras = [camera for camera, there in enumerate(plates) if there]
    return each_camera(lambda c: _masker(capture, c), cameras, capture.num_frames, workers, "masks")


def _masker(capture: MultiviewCapture, camera: int) -> View:
    """What writes the masks of one camera."""
    files = capture.files.apart()
    plate = files.plate(camera)
    masks = capture.path / "masks" / capture.lenses[camera].name

    def write(frame: int) -> int:
        if files.file("masks", camera, frame) is not None:
            return 0
        picture = files.picture(camera, frame)
        if picture is None or plate is None:
            return 0
        write_one_of_many(masks / f"{frame:06d}.png", png(matte(picture[..., :3], plate)))
        return 1

    return write


def png(picture: np.ndarray) -> bytes:
    """Encodes a uint8 picture as PNG."""
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG", compress_level=3)
    return stream.getvalue()
