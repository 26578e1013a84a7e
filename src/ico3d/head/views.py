"""The pictures a head is trained on or measured with."""

import hashlib
import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ico3d.capture.box import Box, cut_out
from ico3d.capture.capture import Capture
from ico3d.capture.decoding import to_bytes
from ico3d.capture.pictures import View as View
from ico3d.capture.reading.layer_cache import LayerCache, ReadAhead
from ico3d.capture.reading.memory import Gib
from ico3d.capture.reading.spill import Layers
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.errors import CaptureError

log = logging.getLogger(__name__)

COMPARED = 16
"""Number of head poses that are hashed to identify a head space."""
GREY = 0.5
"""Background of a person who is cut out to be measured or shown."""
FACING = np.array([0.0, 0.0, 1.0])
"""Viewing direction of the face in canonical head space."""
SHOWS_MOUTH = float(np.cos(np.radians(75.0)))
"""Least cosine of the angle to the face at which a camera sees the mouth well enough."""


@dataclass(frozen=True)
class Picture:
    """What a recorded view shows.

    Attributes:
        image: (H, W, 3) in [0, 1].
        mask: (H, W) in [0, 1], 1 on the person; None where the capture has none.
        torso: (H, W) in [0, 1], 1 on the person except the head; None where the capture does not
            tell them apart.
        behind: (H, W, 3) what the camera sees in this frame without what `mask` shows, where that
            differs from frame to frame; else None.
    """

    image: Tensor
    mask: Tensor | None
    torso: Tensor | None
    behind: Tensor | None = None


def staged(
    picture: Picture, plate: Tensor | None, color: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """The background to render over, and the recorded picture on the same background.

    Args:
        picture: The recorded picture and its mask.
        plate: (H, W, 3) what the camera sees without the person; None if unknown.
        color: (3,) background for a person who is cut out because there is no plate; grey by
            default.

    Returns:
        With a background of its own: that, and the unchanged picture. With a plate: the plate and
        the unchanged picture. With a mask only: `color`, and the person blended over `color`. With
        neither: black and the unchanged picture.
    """
    image = picture.image
    if picture.behind is not None:
        return picture.behind, image
    if plate is not None:
        return plate, image
    if picture.mask is None:
        return image.new_zeros(3), image
    behind = image.new_full((3,), GREY) if color is None else color.to(image)
    mask = picture.mask[..., None]  # (H, W, 1)
    return behind, image * mask + behind * (1 - mask)


def head_pose(capture: Capture, frame: int) -> np.ndarray:
    """The head pose W_i (4, 4) of a frame, canonical head space to world.

    Raises:
        CaptureError: If the frame has no finite head pose.
    """
    pose = capture.world_from_head(frame)
    if pose is None or not np.isfinite(pose).all():
        raise CaptureError(
            f"{capture.path}: frame {frame} has no finite head pose: "
            "look at it with ico3d capture check."
        )
    return pose


def poses_digest(capture: Capture) -> str:
    """A hash of some head poses; identifies the canonical head space of a recording."""
    digest = hashlib.sha256()
    for frame in spread(capture.num_frames, COMPARED):
        pose = capture.world_from_head(frame)
        digest.update(b"none" if pose is None else np.round(pose, 5).astype("<f8").tobytes())
    return digest.hexdigest()


def view_of(capture: Capture, camera: int, frame: int) -> View:
    """The view of a frame by a camera, recorded or not."""
    moved = capture.cameras[camera].moved(head_pose(capture, frame))
    return View(camera, frame, moved)


def squareness(camera: Camera) -> float:
    """Cosine of the angle between the face's and a camera's direction, in canonical head space."""
    center = camera.camera_to_world[:3, 3]
    return float(center @ FACING / np.linalg.norm(center))


class PictureCache(ReadAhead):
    """Pictures of a capture, kept in memory as bytes up to a limit, otherwise read at each use."""

    def __init__(self, capture: Capture, cache: Gib, folder: str = ""):
        """Sets the limit of memory, GiB or `auto`, and where to keep what does not fit in it."""
        self._capture = capture
        self._backgrounds: dict[int, Tensor | None] = {}
        super().__init__(LayerCache(self._read, cache, folder))

    def views(self, frames: Sequence[int], least: float = 0.0) -> list[View]:
        """All recorded views of some frames, frame by frame.

        If some of the views have a mask or a clean background, all views without one are left out,
        because training would take their background for a part of the person.

        Args:
            frames: Numbers of the frames.
            least: Share of the recorded views that must remain.

        Raises:
            CaptureError: If fewer views remain.
        """
        told, untold = [], []
        for frame in frames:
            for camera in range(len(self._capture.cameras)):
                if self._capture.has_image(camera, frame):
                    masked = self._capture.has_mask(camera, frame)
                    tells = masked or self._plate(camera) is not None
                    (told if tells else untold).append(view_of(self._capture, camera, frame))
        if told and len(told) < least * (len(told) + len(untold)):
            raise CaptureError(
                f"{self._capture.path}: only {len(told)} of {len(told) + len(untold)} pictures "
                "have a mask or a clean background: make masks for all, or remove those of a few."
            )
        if told and untold:
            log.warning(
                "%s: %d of %d pictures are left out, as they have neither a mask nor a clean "
                "background.", self._capture.path, len(untold), len(told) + len(untold),
            )  # fmt: skip
        return told or untold

    def background(self, view: View, device: torch.device) -> Tensor | None:
        """(H, W, 3) what the view's camera sees without the person; None if unknown."""
        index, plate = view.camera_index, self._plate(view.camera_index)
        if plate is not None and plate.device != device:  # every step wants it there
            plate = self._backgrounds[index] = plate.to(device)
        return plate

    def picture(self, view: View, device: torch.device, box: Box | None = None) -> Picture:
        """The picture and masks of a recorded view, or a part of them, on `device`.

        Raises:
            CaptureError: If the view was not recorded.
        """
        layers = self._cache.layers(view.camera_index, view.frame)
        if layers is None:
            raise CaptureError(
                f"{self._capture.path}: the picture of frame {view.frame} by camera "
                f"{view.camera_index} has vanished."
            )
        image, mask, torso, behind = (
            None if layer is None else _as_floats(cut_out(layer, box), device) for layer in layers
        )
        assert image is not None
        return Picture(image, mask, torso, behind)

    def _plate(self, camera: int) -> Tensor | None:
        """(H, W, 3) what a camera sees without the person."""
        if camera not in self._backgrounds:
            found = self._capture.background(camera)
            self._backgrounds[camera] = None if found is None else torch.from_numpy(found)
        return self._backgrounds[camera]

    def _read(self, camera: int, frame: int) -> Layers | None:
        """Picture, mask, torso, and what is behind where that moves."""
        image = self._capture.image_bytes(camera, frame)
        if image is None:
            return None
        mask = self._capture.mask_bytes(camera, frame)
        behind = self._capture.behind(camera, frame) if self._capture.moves_behind else None
        torso = self._torso(mask, camera, frame)
        return image, mask, torso, None if behind is None else to_bytes(behind)

    def _torso(self, mask: np.ndarray | None, camera: int, frame: int) -> np.ndarray | None:
        """uint8 (H, W) the person without the head."""
        if mask is None or not self._capture.tells_head:
            return None
        head = self._capture.head_mask_bytes(camera, frame)
        if head is None:
            return None
        torso = np.maximum(mask, head) - head
        return torso if torso.any() else None


def _as_floats(picture: np.ndarray, device: torch.device) -> Tensor:
    return torch.from_numpy(picture).to(device).float().div_(255)
