"""The pictures that a body is trained on: the person cut out, and little around them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.capture.pictures import LayerCache, Layers, View
from ico3d.errors import CaptureError

MARGIN = 8
"""Pixels around the person that are kept: what lies outside of the mask must learn to be empty."""


@dataclass(frozen=True)
class Example:
    """What one picture asks of a body.

    Attributes:
        target: (H, W, 3) the person before `color`.
        mask: (H, W) in [0, 1].
        color: (3,) what they stand before.
    """

    target: Tensor
    mask: Tensor
    color: Tensor


class BodyViews:
    """Pictures of some frames by a capture's training cameras, cropped to the person."""

    def __init__(self, capture: Capture, cache_gib: float):
        """Reads nothing yet.

        Args:
            capture: Where pictures and masks come from.
            cache_gib: Memory for pictures.
        """
        self._capture = capture
        self._boxes: dict[tuple[int, int], tuple[int, int, int, int] | None] = {}
        self._plates: dict[int, np.ndarray | None] = {}
        self._cache = LayerCache(self._read, cache_gib)

    def views(self, frames: Iterable[int]) -> list[View]:
        """The recorded views of these frames by training cameras in which the person is seen.

        Raises:
            CaptureError: If there is none, or a view has no mask.
        """
        held_out = self._capture.split.test_cameras
        chosen = [i for i in range(len(self._capture.cameras)) if i not in held_out]
        found = []
        for frame in frames:
            for camera in chosen:
                if self._cache.layers(camera, frame) is not None:
                    box = self._boxes[camera, frame]
                    assert box is not None
                    found.append(View(camera, frame, self._capture.cameras[camera].cropped(*box)))
        if not found:
            raise CaptureError(f"{self._capture.path} has no picture of the person to train on.")
        return found

    def example(self, view: View, color: np.ndarray, device: torch.device) -> Example:
        """What a view asks for, before a colour (3,)."""
        layers = self._cache.layers(view.camera_index, view.frame)
        assert layers is not None and layers[0] is not None and layers[1] is not None
        person, mask = (torch.from_numpy(part).to(device).float() / 255 for part in layers)  # type: ignore[arg-type]
        behind = torch.from_numpy(color).to(device).float()
        return Example(person + (1 - mask[..., None]) * behind, mask, behind)

    def _read(self, camera: int, frame: int) -> Layers | None:
        """The person on black (h, w, 3) and the mask (h, w), cropped; None where nobody is seen."""
        image = self._capture.image(camera, frame)
        if image is None:
            return None
        mask = self._capture.mask(camera, frame)
        if mask is None:
            name = self._capture.cameras[camera].name
            raise CaptureError(
                f"{self._capture.path}: frame {frame} of camera {name} has no mask: a body is "
                "trained on the person alone; make masks with ico3d capture track."
            )
        box = _box(mask)
        self._boxes[camera, frame] = box
        if box is None:
            return None
        left, top, width, height = box
        cut = np.s_[top : top + height, left : left + width]
        outside = 1 - mask[cut][..., None]
        plate = self._plate(camera)
        person = image[cut] * (1 - outside) if plate is None else image[cut] - outside * plate[cut]
        return person.clip(0, 1), mask[cut]

    def _plate(self, camera: int) -> np.ndarray | None:
        """(H, W, 3) what a camera sees without the person, where that is known."""
        if camera not in self._plates:
            self._plates[camera] = self._capture.background(camera)
        return self._plates[camera]


def _box(mask: np.ndarray) -> tuple[int, int, int, int] | None:
    """Left, top, width, height of what is inside a mask, with a margin; None where nothing is."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if len(rows) == 0:
        return None
    top, left = max(rows[0] - MARGIN, 0), max(columns[0] - MARGIN, 0)
    bottom = min(rows[-1] + 1 + MARGIN, mask.shape[0])
    right = min(columns[-1] + 1 + MARGIN, mask.shape[1])
    return int(left), int(top), int(right - left), int(bottom - top)
