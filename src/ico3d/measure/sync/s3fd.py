"""S3FD: the face detector that the published pipeline of SyncNet uses."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from ico3d.common.weights import model_file
from ico3d.head.perceptual import vgg_layers
from ico3d.measure.sync.network import load_state

WEIGHTS = "sfd_face.pth"
"""File of the public weights, a PyTorch state dictionary."""
MEAN = (123.0, 117.0, 104.0)
"""Mean red, green and blue from 0 to 255."""
VARIANCES = (0.1, 0.2)
"""Scales of the network's shifts and of the logarithms of its sizes."""
CONFIDENCE = 0.9
MOST_BOXES, MOST_KEPT = 5000, 750
"""Numbers of boxes that go into the first suppression of overlaps, and come out of it."""
OVERLAPS = (0.3, 0.1)
"""Greatest overlaps (intersection over union) of the two suppressions, one after the other."""


@dataclass(frozen=True)
class Level:
    """A map of features in which faces of one size are looked for.

    Attributes:
        channels: Number of features.
        step: Distance of neighbours in pixels of the picture; anchors are four times as large.
    """

    channels: int
    step: int


LEVELS = (
    *(Level(256, 4), Level(512, 8), Level(512, 16)),
    *(Level(1024, 32), Level(512, 64), Level(256, 128)),
)


class L2Norm(nn.Module):
    """Scales each pixel's features to a length of 1, then each feature by a learnt weight."""

    def __init__(self, channels: int):
        """Makes the layer with weights of 1."""
        super().__init__()
        self.weight = nn.Parameter(torch.ones(channels))

    def forward(self, values: Tensor) -> Tensor:
        """Features (N, C, h, w) of any length, scaled."""
        unit = values / (values.norm(dim=1, keepdim=True) + 1e-10)
        return self.weight[:, None, None] * unit


class S3fd(nn.Module):
    """Single shot scale-invariant face detector (Zhang et al., ICCV 2017).

    Modules are named as in the public file of weights.
    """

    def __init__(self):
        """Makes the network with PyTorch's initial weights, ready for measuring."""
        super().__init__()
        channels = (64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512, 0)
        wide, narrow = nn.Conv2d(512, 1024, 3, padding=6, dilation=6), nn.Conv2d(1024, 1024, 1)
        base = [*vgg_layers(channels), wide, nn.ReLU(), narrow, nn.ReLU()]
        base[16] = nn.MaxPool2d(2, ceil_mode=True)  # odd sides keep their last row and column
        self.vgg = nn.ModuleList(base)
        self.L2Norm3_3, self.L2Norm4_3, self.L2Norm5_3 = L2Norm(256), L2Norm(512), L2Norm(512)
        self.extras = nn.ModuleList(
            [
                *(nn.Conv2d(1024, 256, 1), nn.Conv2d(256, 512, 3, 2, 1)),
                *(nn.Conv2d(512, 128, 1), nn.Conv2d(128, 256, 3, 2, 1)),
            ]
        )
        self.loc = nn.ModuleList(nn.Conv2d(level.channels, 4, 3, padding=1) for level in LEVELS)
        # On the finest map three kinds of background compete with the face.
        self.conf = nn.ModuleList(
            nn.Conv2d(level.channels, 2 if k else 4, 3, padding=1) for k, level in enumerate(LEVELS)
        )
        self.eval().requires_grad_(False)

    def forward(self, picture: Tensor) -> Tensor:
        """Boxes of all anchors of a picture, most of which are no faces.

        Args:
            picture: (H, W, 3) red, green, blue from 0 to 255.

        Returns:
            (A, 5): left, top, right, bottom in pixels, and the confidence in [0, 1].
        """
        values = (picture - picture.new_tensor(MEAN)).permute(2, 0, 1)[None]  # (1, 3, H, W)
        boxes = []
        for k, features in enumerate(self._features(values)):
            shifts = self.loc[k](features)[0].flatten(1).T  # (h·w, 4)
            scores = self.conf[k](features)[0].flatten(1).T  # (h·w, 4 or 2)
            background = scores[:, :-1].max(1).values
            confidence = torch.stack([background, scores[:, -1]], 1).softmax(1)[:, 1]  # (h·w,)
            found = _boxes(shifts, LEVELS[k].step, features.shape[-1])  # (h·w, 4)
            boxes.append(torch.cat([found, confidence[:, None]], 1))
        return torch.cat(boxes)

    def _features(self, values: Tensor) -> list[Tensor]:
        """Maps of features of a picture (1, 3, H, W), one for each of `LEVELS`."""
        found = []
        norms = {15: self.L2Norm3_3, 22: self.L2Norm4_3, 29: self.L2Norm5_3}
        for k, layer in enumerate(self.vgg):
            values = layer(values)
            if k in norms:
                found.append(norms[k](values))
        found.append(values)
        for k, layer in enumerate(self.extras):
            values = layer(values).relu()
            if k % 2:
                found.append(values)
        return found


def load_s3fd() -> S3fd:
    """The detector with the public weights.

    Raises:
        MissingModelError: If the weights are not installed.
        ModelError: If the file does not hold them.
    """
    network = S3fd()
    load_state(network, model_file(WEIGHTS, "finding faces as SyncNet's pipeline does"))
    return network


def faces_of(boxes: Tensor) -> Tensor:
    """Those boxes that are faces, the most confident first.

    Args:
        boxes: (A, 5) as the network returns them.

    Returns:
        (F, 5) boxes of more than `CONFIDENCE`; of boxes that overlap, the most confident one.
    """
    sure = boxes[boxes[:, 4] > CONFIDENCE]
    sure = sure[sure[:, 4].argsort(descending=True, stable=True)][:MOST_BOXES]
    first = _suppressed(sure, OVERLAPS[0])[:MOST_KEPT]
    return _suppressed(first, OVERLAPS[1])


def _boxes(shifts: Tensor, step: int, width: int) -> Tensor:
    """Corners (N, 4) of the boxes that shifts (N, 4) of a map's anchors stand for."""
    place = torch.arange(len(shifts), device=shifts.device)
    anchors = (torch.stack([place % width, place // width], 1) + 0.5) * step  # (N, 2)
    size = 4.0 * step
    centers = anchors + shifts[:, :2] * VARIANCES[0] * size  # (N, 2)
    sizes = size * (shifts[:, 2:] * VARIANCES[1]).exp()  # (N, 2)
    return torch.cat([centers - sizes / 2, centers + sizes / 2], 1)


def _suppressed(boxes: Tensor, most: float) -> Tensor:
    """Boxes (N, 5) in the order of confidence, without those that overlap a kept one too much."""
    kept = []
    left = boxes
    while len(left):
        best, left = left[0], left[1:]
        kept.append(best)
        low, high = torch.maximum(left[:, :2], best[:2]), torch.minimum(left[:, 2:4], best[2:4])
        common = (high - low).clamp_min(0).prod(1)  # (N,)
        areas = (left[:, 2:4] - left[:, :2]).prod(1) + (best[2:4] - best[:2]).prod()
        left = left[common / (areas - common) <= most]
    return torch.stack(kept) if kept else boxes
