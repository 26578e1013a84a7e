"""The pictures that a body is trained on: the person cut out, with a small margin."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.capture.pictures import LayerCache, Layers, View, read_in_turn, train_cameras
from ico3d.errors import CaptureError
from ico3d.rig.body_track import BodyTrack

MARGIN = 8
"""Margin in pixels around the person, in which the body learns that there is nothing."""


@dataclass(frozen=True)
class Example:
    """A recorded picture as a body learns from it.

    Attributes:
        target: (H, W, 3) RGB picture of the person before `color`.
        mask: (H, W) mask of the person, in [0, 1].
        color: (3,) RGB background.
    """

    target: Tensor
    mask: Tensor
    color: Tensor


class BodyViews:
    """Pictures of some frames by a capture's training cameras, cropped to the person.

    All pictures of a camera have the same crop, which holds the person in every frame, so that a
    Gaussian that stays where a hand was in another frame is seen to be wrong.

    Attributes:
        views: The recorded views in which the person is seen, frame by frame.
    """

    def __init__(self, capture: Capture, frames: Iterable[int], cache_gib: float):
        """Reads all masks, of which it takes the crops.

        Args:
            capture: The recording.
            frames: Frames to train on.
            cache_gib: Memory for pictures in GiB.

        Raises:
            CaptureError: If there is no picture of the person, or a view has no mask.
        """
        self._capture = capture
        self._plates: dict[int, np.ndarray | None] = {}
        self._cache = LayerCache(self._read, cache_gib)
        frames, shown = list(frames), set[tuple[int, int]]()
        self._boxes = {
            camera: box
            for camera in train_cameras(capture)
            if (box := self._common_box(camera, frames, shown)) is not None
        }
        self.views = [
            View(camera, frame, capture.cameras[camera].cropped(*box.place))
            for frame in frames
            for camera, box in self._boxes.items()
            if (camera, frame) in shown and capture.has_image(camera, frame)
        ]
        if not self.views:
            raise CaptureError(f"{capture.path} has no picture of the person to train on.")

    def body_track(self) -> BodyTrack | None:
        """The body track of the recording; None where it has none."""
        return self._capture.body_track()

    def example(self, view: View, color: np.ndarray, device: torch.device) -> Example:
        """The recorded picture of a view, with the person before a colour (3,)."""
        layers = self._cache.layers(view.camera_index, view.frame)
        assert layers is not None and layers[0] is not None and layers[1] is not None
        person, mask = (torch.from_numpy(part).to(device).float() / 255 for part in layers)  # type: ignore[arg-type]
        behind = torch.from_numpy(color).to(device).float()
        return Example(person + (1 - mask[..., None]) * behind, mask, behind)

    def expect(self, views: Iterable[View]) -> None:
        """Begins to read views that will be asked for soon."""
        self._cache.expect(views)

    def _common_box(
        self, camera: int, frames: Iterable[int], shown: set[tuple[int, int]]
    ) -> "_Box | None":
        """The crop that holds the person in all frames of a camera; None where nobody is seen.

        Args:
            camera: Index of the camera.
            frames: Frames to look at.
            shown: Gets camera and frame of each view that shows the person.
        """
        seen = self._capture.cameras[camera]
        inside = np.zeros((seen.height, seen.width), bool)
        for frame, mask in read_in_turn(partial(self._mask, camera), frames):
            if mask is not None and mask.any():
                inside |= mask > 0
                shown.add((camera, frame))
        return _Box.around(inside) if inside.any() else None

    def _mask(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W) mask of the person; None where there is no picture either.

        Raises:
            CaptureError: If there is a picture without a mask.
        """
        mask = self._capture.mask(camera, frame)
        if mask is None and self._capture.has_image(camera, frame):
            name = self._capture.cameras[camera].name
            raise CaptureError(
                f"{self._capture.path}: frame {frame} of camera {name} has no mask: a body is "
                "trained on the person alone; record clean plates and make masks of them."
            )
        return mask

    def _read(self, camera: int, frame: int) -> Layers | None:
        """The person on black (h, w, 3) and the mask (h, w), cropped; None where nobody is seen."""
        image = self._capture.image(camera, frame)
        if image is None:
            return None
        mask, cut = self._mask(camera, frame), self._boxes[camera].cut
        if mask is None or not mask.any():
            return None
        outside = 1 - mask[cut][..., None]
        plate = self._plate(camera)
        person = image[cut] * (1 - outside) if plate is None else image[cut] - outside * plate[cut]
        return person.clip(0, 1), mask[cut]

    def _plate(self, camera: int) -> np.ndarray | None:
        """(H, W, 3) clean background of a camera; None where it is not known."""
        if camera not in self._plates:
            self._plates[camera] = self._capture.background(camera)
        return self._plates[camera]


@dataclass(frozen=True)
class _Box:
    """A rectangle of pixels in a picture.

    Attributes:
        place: Left, top, width and height in pixels.
    """

    place: tuple[int, int, int, int]

    @staticmethod
    def around(inside: np.ndarray) -> "_Box":
        """The rectangle that holds all marked pixels of `inside` (H, W) bool, with `MARGIN`."""
        rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
        top, left = max(rows[0] - MARGIN, 0), max(columns[0] - MARGIN, 0)
        bottom = min(rows[-1] + 1 + MARGIN, inside.shape[0])
        right = min(columns[-1] + 1 + MARGIN, inside.shape[1])
        return _Box((int(left), int(top), int(right - left), int(bottom - top)))

    @property
    def cut(self) -> tuple[slice, slice]:
        """The rectangle as slices of rows and of columns."""
        left, top, width, height = self.place
        return slice(top, top + height), slice(left, left + width)
