"""Crops of recorded pictures about the mouth.

A mouth changes most of all parts of a head, and a picture of 256² shows it on 2 % of its pixels: it
has hardly begun to be learnt when skin and hair are finished. A crop costs a fifth of a picture.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ico3d.capture.box import Box
from ico3d.capture.capture import Capture
from ico3d.capture.face.canonical import canonical_landmarks
from ico3d.capture.face.region import MOUTH
from ico3d.common.camera import Camera
from ico3d.head.views import SHOWS_MOUTH, View, squareness
from ico3d.training.epochs import Epochs

REACH = 0.75
"""Half of a crop's side, relative to the width of the mouth."""
LEAST_SIDE = 16
"""Least width and height in pixels of a crop: SSIM looks at 11 pixels."""
MARGIN = 0.15
"""How far beyond a crop Gaussians are drawn, relative to its longer side."""


@dataclass(frozen=True)
class CloseUp:
    """A part of a view.

    Attributes:
        view: The whole view.
        box: The part of its picture, in pixels.
    """

    view: View
    box: Box

    @property
    def part(self) -> View:
        """The view whose camera sees the part alone."""
        return replace(self.view, camera=self.view.camera.cropped(*self.box.place))

    def shown(self, means: Tensor) -> Tensor:
        """Numbers (n,), int64 and on the CPU, of the Gaussians (N, 3) at or about the part."""
        places, depths = self.view.camera.project(means.detach().cpu().numpy())  # (N, 2), (N,)
        low = np.array([self.box.left, self.box.top], float)
        size = np.array([self.box.width, self.box.height], float)
        away = np.abs(places - (low + size / 2)) - size / 2  # (N, 2) pixels beyond the part
        near = (away < MARGIN * size.max()).all(1) & (depths > 0)
        return torch.from_numpy(np.flatnonzero(near))


class CloseUps:
    """The close-ups of some views that training takes up, in an order that depends on the seed."""

    def __init__(self, capture: Capture, views: Sequence[View], seed: int):
        """Finds the mouth in all views that show it, by the landmarks' mean places in head space.

        Args:
            capture: The recording. Without landmarks there is no close-up.
            views: Views in canonical head space.
            seed: Seed of the order.
        """
        landmarks = canonical_landmarks(capture)
        self._all = [] if landmarks is None else _close_ups(landmarks[MOUTH], views)
        self._epochs = Epochs([seed, 3], max(len(self._all), 1))

    def __len__(self) -> int:
        """The number of close-ups."""
        return len(self._all)

    def at(self, index: int) -> CloseUp:
        """The close-up that is taken up as number `index`."""
        return self._all[self._epochs.at(index)]


def _close_ups(mouth: np.ndarray, views: Sequence[View]) -> list[CloseUp]:
    """Close-ups of a mouth (20, 3) that are not too small."""
    seen = [view for view in views if squareness(view.camera) > SHOWS_MOUTH]
    boxes = [_box(mouth, view.camera) for view in seen]
    return [
        CloseUp(view, box)
        for view, box in zip(seen, boxes, strict=True)
        if min(box.width, box.height) >= LEAST_SIDE
    ]


def _box(mouth: np.ndarray, camera: Camera) -> Box:
    """The square about a mouth (20, 3), as far as it lies in the picture."""
    width = float(np.ptp(mouth[:, 0]))
    place, depth = camera.project(mouth.mean(0))  # (2,), ()
    half = REACH * width * camera.intrinsics[0, 0] / float(depth)
    low = np.floor(np.clip(place - half, 0, (camera.width, camera.height))).astype(int)
    high = np.ceil(np.clip(place + half, 0, (camera.width, camera.height))).astype(int)
    return Box(int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1]))
