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
from ico3d.head.views import SHOWS_MOUTH, View, squareness
from ico3d.training.epochs import Epochs

REACH = 0.75
"""Half of a crop's side, relative to the width of the mouth."""
LEAST_SIDE = 16
"""Least width and height in pixels of a crop: SSIM looks at 11 pixels."""
DEPTH = 1.25
"""How far before and behind the mouth Gaussians are drawn, relative to its width."""
MARGIN = 0.15
"""How far beyond a crop Gaussians are drawn, relative to its longer side."""


@dataclass(frozen=True)
class CloseUp:
    """A part of a view.

    Attributes:
        view: The whole view.
        box: The part of its picture, in pixels.
        depths: Least and largest depth in metres of Gaussians that belong to the part.
    """

    view: View
    box: Box
    depths: tuple[float, float]

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
        nearest, farthest = self.depths
        near = (away < MARGIN * size.max()).all(1) & (depths > nearest) & (depths < farthest)
        return torch.from_numpy(np.flatnonzero(near))


class CloseUps:
    """Close-ups of the mouth in some views, in an order that depends on the seed.

    Attributes:
        views: The views that show the mouth, and not too small.
    """

    def __init__(self, capture: Capture, views: Sequence[View], seed: int):
        """Finds the mouth in all views, by the landmarks' mean places in head space.

        Args:
            capture: The recording. Without landmarks there is no close-up.
            views: Views in canonical head space.
            seed: Seed of the order.
        """
        landmarks = canonical_landmarks(capture) if views else None
        self._mouth = None if landmarks is None else landmarks[MOUTH]  # (20, 3)
        self.views = [] if self._mouth is None else [v for v in views if self._shows_mouth(v)]
        self._epochs = Epochs([seed, 3], max(len(self.views), 1))

    def __len__(self) -> int:
        """The number of close-ups."""
        return len(self.views)

    def place(self, number: int) -> int:
        """The index in `views` of the view that is taken up as this number."""
        return self._epochs.at(number)

    def about(self, view: View) -> CloseUp:
        """The close-up of a view: the square about the mouth, as far as the picture shows it."""
        assert self._mouth is not None
        camera, width = view.camera, float(np.ptp(self._mouth[:, 0]))
        middle, depths = camera.project(self._mouth.mean(0))  # (2,), ()
        depth = float(depths)
        half = REACH * width * camera.intrinsics[0, 0] / depth
        most = (camera.width, camera.height)
        low = np.floor(np.clip(middle - half, 0, most)).astype(int)
        high = np.ceil(np.clip(middle + half, 0, most)).astype(int)
        box = Box(*low.tolist(), *(high - low).tolist())
        return CloseUp(view, box, (depth - DEPTH * width, depth + DEPTH * width))

    def at_mouth(self, means: Tensor) -> Tensor:
        """(N,) bool: which Gaussians (N, 3) lie about the mouth, on the CPU; none without it."""
        if self._mouth is None:
            return torch.zeros(len(means), dtype=torch.bool)
        reach = REACH * float(np.ptp(self._mouth[:, 0]))
        middle = torch.from_numpy(self._mouth.mean(0)).to(means.dtype)
        return (means.detach().cpu() - middle).norm(dim=1) < reach

    def _shows_mouth(self, view: View) -> bool:
        if squareness(view.camera) <= SHOWS_MOUTH:
            return False
        box = self.about(view).box
        return min(box.width, box.height) >= LEAST_SIDE
