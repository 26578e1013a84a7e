"""Pictures of a body's capture that show the face, cropped to it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.similarity import moved
from ico3d.capture.capture import Capture
from ico3d.capture.face.region import BROWS, CHIN, HeadRegion
from ico3d.capture.pictures import train_cameras
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.errors import CaptureError

WIDEST = np.cos(np.radians(65.0))
"""Cosine of the largest angle, 65°, between the face's direction and that to the camera."""
MARGIN = 0.35
"""Margin around the landmarks in a crop, relative to the larger side of their bounding box."""
MOST = 120
"""Default of the largest number of pictures."""
CHANGING = ((slice(48, 68), 0.3), (slice(36, 42), 0.14), (slice(42, 48), 0.14))
"""Landmarks of mouth and eyes, each with the radius of the disc that expressions change.

Radii are relative to the height of the face in the picture, from chin to brows.
"""
LEAST = 4
"""Least width and height of a crop in pixels."""


@dataclass(frozen=True)
class FaceView:
    """A recorded picture cropped to the face.

    Attributes:
        frame: Frame of the recording.
        camera_index: Index of the camera in the recording.
        camera: The camera of the cropped picture, in the world.
        image: (H, W, 3) float32 RGB.
        mask: (H, W) mask of the person.
        steady: (H, W) 0 about mouth and eyes, which change with the expression, else 1.
    """

    frame: int
    camera_index: int
    camera: Camera
    image: Tensor
    mask: Tensor
    steady: Tensor

    def to(self, device: torch.device) -> "FaceView":
        """This view on another device."""
        names = ("image", "mask", "steady")
        return replace(self, **{name: getattr(self, name).to(device) for name in names})


def face_views(
    capture: Capture,
    placement: Placement,
    region: HeadRegion,
    landmarks: np.ndarray,
    cameras: Sequence[int] | None = None,
    most: int = MOST,
) -> list[FaceView]:
    """Views of the face by cameras in front of it, evenly spread over frames and cameras.

    Args:
        capture: The recording of the whole person.
        placement: Where the head is in each frame.
        region: Region of the head's model, for the direction in which the face looks.
        landmarks: (68, 3) landmarks in the space of the head's model.
        cameras: Indices of the cameras; the training cameras by default.
        most: Number of views at most.

    Raises:
        CaptureError: If no camera is in front of the face, or none that is has a picture of the
            face with a mask.
    """
    chosen_cameras = train_cameras(capture) if cameras is None else cameras
    seen = [
        (frame, camera)
        for frame in range(capture.num_frames)
        for camera in chosen_cameras
        if faces(capture.cameras[camera], placement.world_from_head(frame), region, landmarks)
    ]
    chosen = [seen[i] for i in spread(len(seen), most)]
    views = [_view(capture, placement, landmarks, *place) for place in chosen]
    found = [view for view in views if view is not None]
    if not seen:
        raise CaptureError(f"{capture.path}: no camera sees the face: check the head's poses.")
    if not found:
        raise CaptureError(
            f"{capture.path}: no camera in front of the face has a picture of it with a mask: look "
            "with ico3d capture check."
        )
    return found


def faces(
    camera: Camera, world_from_head: np.ndarray, region: HeadRegion, landmarks: np.ndarray
) -> bool:
    """Whether a camera is in front of a face, by no more than 65° aside.

    Args:
        camera: The camera in the world.
        world_from_head: (4, 4) similarity that places the head.
        region: Region of the head's model, for the direction in which the face looks.
        landmarks: (68, 3) landmarks in the space of the head's model.
    """
    centre = moved(world_from_head, landmarks.mean(0))
    towards = camera.camera_to_world[:3, 3] - centre
    forward = world_from_head[:3, :3] @ region.forward
    cosine = towards @ forward / (np.linalg.norm(towards) * np.linalg.norm(forward))
    return bool(cosine > WIDEST)


def _view(
    capture: Capture, placement: Placement, landmarks: np.ndarray, frame: int, index: int
) -> FaceView | None:
    """One cropped picture; None where the face is not in it, or picture or mask is missing."""
    camera = capture.cameras[index]
    points = moved(placement.world_from_head(frame), landmarks)  # (68, 3)
    if (moved(camera.world_to_camera, points)[:, 2] <= 0).any():
        return None
    pixels, _ = camera.project(points)  # (68, 2)
    low, high = pixels.min(0), pixels.max(0)
    reach = MARGIN * (high - low).max()
    size = np.array([camera.width, camera.height])
    left, top = np.floor(low - reach).clip(0, size - 1).astype(int)
    right, bottom = np.ceil(high + reach).clip(1, size).astype(int)
    if right - left < LEAST or bottom - top < LEAST:
        return None
    image, mask = capture.image(index, frame), capture.mask(index, frame)
    if image is None or mask is None:
        return None
    cut = slice(top, bottom), slice(left, right)
    crop = camera.cropped(int(left), int(top), int(right - left), int(bottom - top))
    parts = torch.from_numpy(image[cut].copy()), torch.from_numpy(mask[cut].copy())
    steady = torch.from_numpy(_steady(pixels - (left, top), image[cut].shape[:2]))
    return FaceView(frame, index, crop, *parts, steady)


def _steady(pixels: np.ndarray, size: tuple[int, ...]) -> np.ndarray:
    """(H, W) float32: 0 in discs about mouth and eyes, else 1; landmarks are at pixels (68, 2)."""
    rows, columns = np.indices(size) + 0.5  # (H, W) each
    height = np.linalg.norm(pixels[BROWS].mean(0) - pixels[CHIN])
    steady = np.ones(size, np.float32)
    for part, radius in CHANGING:
        x, y = pixels[part].mean(0)
        steady[np.hypot(columns - x, rows - y) < radius * height] = 0
    return steady
