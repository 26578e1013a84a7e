"""The pictures on which a static scene is trained and measured."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.capture.decoding import to_bytes
from ico3d.capture.pictures import View
from ico3d.capture.reading.layer_cache import LayerCache, ReadAhead
from ico3d.capture.reading.memory import Gib
from ico3d.capture.reading.spill import Layers
from ico3d.common.camera import Camera
from ico3d.errors import CaptureError

Only = Literal["all", "person", "background"]
Frames = int | Literal["all"]
Space = Literal["world", "head"]

TEST_EVERY = 8
"""Of a single frame's pictures every 8th, starting with the first, is a test picture.

This is the usual rule for static scenes (LLFF's). With fewer pictures all are training pictures.
"""


@dataclass(frozen=True)
class Example:
    """A recorded picture, prepared for training a scene.

    Attributes:
        target: (H, W, 3) picture that the rendering should match.
        behind: (3,) colour to render over; None for black.
        weight: (H, W) weight of each pixel in [0, 1]; None where all count fully.
    """

    target: Tensor
    behind: Tensor | None
    weight: Tensor | None

    def to(self, device: torch.device) -> "Example":
        """The same example on another device."""
        parts = (self.target, self.behind, self.weight)
        return Example(*(None if part is None else part.to(device) for part in parts))  # type: ignore[arg-type]


class SceneViews(ReadAhead):
    """The pictures of a capture for a static scene.

    The scene of a person with known head poses lies in canonical head space, so that movements of
    the head do not blur it; every other scene lies in the world. A background is taken from clean
    plates where the capture has them, else from what lies outside the masks.

    Attributes:
        path: Folder of the capture.
        only: Which part of the pictures counts: the person, the background, or all.
        space: The space of the scene: `world` or `head`.
        train: Views for training.
        test: Views for measuring: the capture's test frames, or every 8th view of a single frame.
    """

    def __init__(self, capture: Capture, only: Only, frames: Frames, cache: Gib, folder: str = ""):
        """Finds the recorded views.

        Args:
            capture: The recording.
            only: The part of the pictures to train: all, the person, or the background.
            frames: All frames, or the number of one.
            cache: Memory for pictures, GiB, or `auto`.
            folder: Where to keep pictures that do not fit in memory; "" for nowhere.

        Raises:
            CaptureError: If there are no pictures, a mask is missing, or there is no such frame.
        """
        if frames != "all" and not 0 <= frames < capture.num_frames:
            raise CaptureError(
                f"{capture.path} has frames 0 to {capture.num_frames - 1}, not {frames}."
            )
        self._capture, self.path, self.only = capture, capture.path, only
        self._plates = only == "background" and capture.background(0) is not None
        follows = only == "person" and capture.world_from_head(0) is not None
        self.space: Space = "head" if follows else "world"
        super().__init__(LayerCache(self._read, cache, folder))
        self._known_plates: dict[int, Tensor | None] = {}
        if frames == "all" and capture.split.train and capture.split.test and not self._plates:
            self.train = self._views(capture.split.train)
            self.test = self._views(capture.split.test)
        else:
            self.train, self.test = _every_eighth(self._views(self._moment(frames)))
        if not self.train:
            raise CaptureError(f"{capture.path} has no picture among its training frames.")

    def layers(self, view: View) -> tuple[Tensor, Tensor | None]:
        """Picture (H, W, 3) and mask (H, W) of a view, on the CPU.

        Raises:
            CaptureError: If the view was not recorded.
        """
        found = self._cache.layers(view.camera_index, view.frame)
        if found is None:
            raise CaptureError(f"{self._where(view)} has vanished.")
        image, mask = (None if layer is None else torch.from_numpy(layer) / 255 for layer in found)
        assert image is not None
        return image, mask

    def plate(self, view: View) -> Tensor | None:
        """(H, W, 3) what the view's camera sees without the person; None if unknown."""
        index = view.camera_index
        if index not in self._known_plates:
            found = self._capture.background(index)
            self._known_plates[index] = None if found is None else torch.from_numpy(found)
        return self._known_plates[index]

    def example(self, view: View, color: np.ndarray) -> Example:
        """The picture of a view, prepared for training or measuring.

        Args:
            view: One of `train` or `test`.
            color: (3,) background behind a person who is cut out.

        Raises:
            CaptureError: If the person is wanted and this view has no mask.
        """
        image, mask = self.layers(view)
        if self.only == "person":
            if mask is None:
                raise CaptureError(
                    f"{self._where(view)} has no mask: record clean plates and make masks, "
                    "or train with --only all."
                )
            behind = torch.from_numpy(color).float()
            outside, plate = 1 - mask[..., None], self.plate(view)  # (H, W, 1)
            person = image * mask[..., None] if plate is None else image - outside * plate
            return Example(person + outside * behind, behind, None)
        weight = 1 - mask if self.only == "background" and mask is not None else None
        return Example(image, None, weight)

    def _views(self, frames: Sequence[int]) -> tuple[View, ...]:
        """All recorded views of these frames, in this scene's space."""
        cameras = range(len(self._capture.cameras))
        return tuple(
            View(camera, frame, self._camera(camera, frame))
            for frame in frames
            for camera in cameras
            if self._is_recorded(camera, frame)
        )

    def _is_recorded(self, camera: int, frame: int) -> bool:
        """Whether there is something to read for a view."""
        if self._plates:
            return self._cache.layers(camera, frame) is not None  # one plate for each camera
        return self._capture.has_image(camera, frame)

    def _moment(self, frames: Frames) -> Sequence[int]:
        """The frames that count as one moment; a plate is the same in all of them."""
        if self._plates:
            return (0,)
        return range(self._capture.num_frames) if frames == "all" else (frames,)

    def _camera(self, camera: int, frame: int) -> Camera:
        """A camera in this scene's space."""
        seen = self._capture.cameras[camera]
        if self.space == "world":
            return seen
        pose = self._capture.world_from_head(frame)
        if pose is None or not np.isfinite(pose).all():
            raise CaptureError(
                f"{self.path}: frame {frame} has no finite head pose: "
                "look at it with ico3d capture check."
            )
        return seen.moved(pose)

    def _read(self, camera: int, frame: int) -> Layers | None:
        """Picture and mask of a view; of a background its clean plate alone."""
        if self._plates:
            plate = self._capture.background(camera)
            return None if plate is None else (to_bytes(plate), None)
        image = self._capture.image_bytes(camera, frame)
        return None if image is None else (image, self._capture.mask_bytes(camera, frame))

    def _where(self, view: View) -> str:
        """Names a picture in an error."""
        return f"{self.path}: the picture of frame {view.frame} by camera {view.camera.name}"


def _every_eighth(views: tuple[View, ...]) -> tuple[tuple[View, ...], tuple[View, ...]]:
    """Views to train on and to test with."""
    if len(views) < TEST_EVERY:
        return views, ()
    kept = tuple(view for place, view in enumerate(views) if place % TEST_EVERY)
    return kept, views[::TEST_EVERY]
