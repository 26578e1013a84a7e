"""Corrects the poses of a portrait capture by its pictures, hair and all."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image
from scipy.ndimage import binary_dilation

from ico3d.capture.portrait import parsing, rigid_head
from ico3d.capture.portrait.files import OPENGL_FROM_OPENCV, load_uint8
from ico3d.capture.progress import Reached
from ico3d.common.camera import Camera
from ico3d.common.device import DeviceName

if TYPE_CHECKING:
    from ico3d.capture.portrait.photometric_poses import Look, Refined

REFINED_SIZE = 256
"""Short side in pixels of the pictures by which poses are corrected."""


def camera_of(track: rigid_head.Track, width: int, height: int) -> Camera:
    """The camera that took the clip, for pictures scaled to this size."""
    scale = np.array([width, height]) / (2 * track.center)
    focal, center = track.focal * scale, track.center * scale
    lens = np.array([[focal[0], 0, center[0]], [0, focal[1], center[1]], [0, 0, 1]])
    return Camera(width, height, lens, OPENGL_FROM_OPENCV)


def refined(
    work: Path,
    frames: Sequence[int],
    track: rigid_head.Track,
    points: np.ndarray,
    device: DeviceName,
    reached: Reached | None,
) -> "Refined":
    """Poses that the pictures agree with.

    Args:
        work: The capture.
        frames: Numbers of the frames that the track has poses of.
        track: The rigid head through these frames.
        points: (P, 3) on the head, canonical head space, metres.
        device: Where to compute.
        reached: Told about progress.
    """
    from ico3d.capture.portrait.photometric_poses import Look, refine_poses

    plate = load_uint8(work / "bc.jpg")
    shrink = max(1, round(min(plate.shape[:2]) / REFINED_SIZE))
    size = (plate.shape[1] // shrink, plate.shape[0] // shrink)

    def small(image: np.ndarray) -> np.ndarray:
        resized = Image.fromarray(image).resize(size, Image.Resampling.BOX)
        return np.asarray(resized, np.float32) / 255

    @lru_cache(maxsize=1024)
    def look(index: int) -> "Look":
        number = frames[index]
        parts = load_uint8(work / "parsing" / f"{number}.png")
        head = parsing.is_class(parts, parsing.FACE, parsing.HAIR, parsing.MOUTH) > 0
        grown = binary_dilation(head, iterations=4)  # outlines tell most
        image = load_uint8(work / "gt_imgs" / f"{number}.jpg")
        return Look(small(image), small(grown.astype(np.uint8) * 255))

    camera = camera_of(track, *size)
    return refine_poses(track.poses(), points, camera, small(plate), look, device, reached=reached)
