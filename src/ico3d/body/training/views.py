"""The pictures that a body is trained on: the person cut out, with a small margin."""

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from rich.console import Console
from rich.progress import track as progress
from torch import Tensor

from ico3d.capture.box import Box
from ico3d.capture.capture import Capture
from ico3d.capture.decoding import to_bytes
from ico3d.capture.pictures import View, train_cameras
from ico3d.capture.reading.layer_cache import LayerCache, ReadAhead, go_on_without, read_in_turn
from ico3d.capture.reading.memory import Gib
from ico3d.capture.reading.spill import Layers
from ico3d.errors import CaptureError
from ico3d.rig.body_track import BodyTrack

log = logging.getLogger(__name__)

MARGIN = 8
"""Margin in pixels around the person, in which the body learns that there is nothing."""
LEAST_TOLD = 0.5
"""Least share of the pictures that must have a mask."""
SHOWN_FROM = 200
"""Number of masks from which on a progress bar shows how far reading them is."""


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


class BodyViews(ReadAhead):
    """Pictures of some frames by a capture's training cameras, cropped to the person.

    All pictures of a camera have the same crop, which holds the person in every frame, so that a
    Gaussian that stays where a hand was in another frame is seen to be wrong.

    Attributes:
        views: The recorded views in which the person is seen, frame by frame.
    """

    def __init__(self, capture: Capture, frames: Iterable[int], cache: Gib, folder: str = ""):
        """Reads all masks, of which it takes the crops.

        Args:
            capture: The recording.
            frames: Frames to train on.
            cache: Memory for pictures in GiB, or `auto`.
            folder: Where to keep pictures that do not fit in memory; "" for nowhere.

        Raises:
            CaptureError: If there is no picture of the person, or less than half of the pictures
                have a mask.
        """
        self._capture = capture
        self._plates: dict[int, np.ndarray | None] = {}
        super().__init__(LayerCache(self._read, cache, folder))
        self._masks: dict[tuple[int, int], np.ndarray] = {}
        frames = list(frames)
        tight = self._find_person([(c, f) for c in train_cameras(capture) for f in frames])
        self._tight = tight
        self._boxes = {camera: self._common_box(camera) for camera in sorted({c for c, _ in tight})}
        self.views = [
            View(camera, frame, capture.cameras[camera].cropped(*box.place))
            for frame in frames
            for camera, box in self._boxes.items()
            if (camera, frame) in tight and capture.has_image(camera, frame)
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

    def _find_person(self, keys: Sequence[tuple[int, int]]) -> dict[tuple[int, int], Box]:
        """The boxes around the person, by camera and frame, where the person is seen.

        Masks are kept, cropped to these boxes, as far as memory goes.

        Raises:
            CaptureError: If too many masks are missing or damaged.
        """
        found, bare, told, lost = {}, [], 0, 0
        masks = read_in_turn(self._mask_or_error, keys)
        if len(keys) >= SHOWN_FROM:
            console = Console(stderr=True)
            masks = progress(
                masks, "finding the person", len(keys), console=console, transient=True
            )
        for key, mask in masks:
            told += mask is not None
            if isinstance(mask, CaptureError):
                lost += 1
                go_on_without(mask, lost, len(keys))
            elif mask is None and self._capture.has_image(*key):
                bare.append(key)
            elif mask is not None and (box := Box.around(mask)) is not None:
                found[key] = box
                if self._cache.budget.take(box.width * box.height):
                    self._masks[key] = mask[box.cut].copy()
        self._leave_out(bare, told)
        return found

    def _mask_or_error(self, key: tuple[int, int]) -> np.ndarray | CaptureError | None:
        """uint8 (H, W) mask of a camera and frame; None where there is none."""
        try:
            return self._capture.mask_bytes(*key)
        except CaptureError as error:
            return error

    def _leave_out(self, bare: Sequence[tuple[int, int]], told: int) -> None:
        """Warns of pictures without masks.

        Args:
            bare: Camera and frame of each.
            told: Number of pictures with a mask.

        Raises:
            CaptureError: If they are too many to go on without.
        """
        if not bare:
            return
        path, cameras = self._capture.path, self._capture.cameras
        if told < LEAST_TOLD * (told + len(bare)):
            camera, frame = bare[0]
            raise CaptureError(
                f"{path}: frame {frame} of camera {cameras[camera].name} has no mask, nor have "
                f"{len(bare) - 1} other pictures: a body is trained on the person alone; record "
                "clean plates and make masks of them."
            )
        names = ", ".join(dict.fromkeys(cameras[camera].name for camera, _ in bare))
        log.warning(
            "%s: %d of %d pictures have no mask and are left out (camera %s).",
            path, len(bare), told + len(bare), names,
        )  # fmt: skip

    def _common_box(self, camera: int) -> Box:
        """The crop that holds the person in all frames of a camera, with `MARGIN`."""
        boxes = [box for (index, _), box in self._tight.items() if index == camera]
        common = boxes[0]
        for box in boxes[1:]:
            common = common.joined(box)
        seen = self._capture.cameras[camera]
        return common.grown(MARGIN, seen.width, seen.height)

    def _mask(self, camera: int, frame: int) -> np.ndarray | None:
        """uint8 (h, w) mask in the camera's crop; None where nobody is seen."""
        box, kept = self._boxes[camera], self._masks.get((camera, frame))
        if kept is None:
            return self._capture.mask_bytes(camera, frame, box)
        mask = np.zeros((box.height, box.width), np.uint8)
        mask[self._tight[camera, frame].within(box).cut] = kept
        return mask

    def _read(self, camera: int, frame: int) -> Layers | None:
        """The person on black (h, w, 3) and the mask (h, w), cropped; None where nobody is seen."""
        image = self._capture.image_bytes(camera, frame, self._boxes[camera])
        mask = None if image is None else self._mask(camera, frame)
        if image is None or mask is None:
            return None
        return without_background(image, mask, self._plate(camera)), mask

    def _plate(self, camera: int) -> np.ndarray | None:
        """uint8 (h, w, 3) clean background in a camera's crop; None where it is not known."""
        if camera not in self._plates:
            plate = self._capture.background(camera)
            cut = self._boxes[camera].cut
            self._plates[camera] = None if plate is None else to_bytes(plate[cut])
        return self._plates[camera]


def without_background(image: np.ndarray, mask: np.ndarray, plate: np.ndarray | None) -> np.ndarray:
    """The person on black.

    Args:
        image: uint8 (h, w, 3) recorded picture.
        mask: uint8 (h, w) mask of the person.
        plate: uint8 (h, w, 3) the same without the person; None where it is not known.

    Returns:
        uint8 (h, w, 3): the picture times the mask; with a plate, the picture less what the plate
        shows through the mask.
    """
    if plate is None:
        person = image * (mask > 0)[..., None]  # (h, w, 3)
    else:
        person = np.where(mask[..., None] > 0, image, np.maximum(image, plate) - plate)
    soft = (mask > 0) & (mask < 255)  # few pixels, along the edge
    shares = mask[soft, None] / np.float32(255)  # (P, 1)
    if plate is None:
        colors = image[soft] * shares  # (P, 3)
    else:
        colors = (image[soft] - (1 - shares) * plate[soft]).clip(0, 255)  # (P, 3)
    person[soft] = (colors + 0.5).astype(np.uint8)
    return person
