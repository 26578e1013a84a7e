"""LPIPS 0.1 (Zhang et al. 2018) with VGG-16 or AlexNet, if their weights are installed.

The definition is that of the authors' package: features of five layers, each pixel's features of
length 1, squared differences weighted by channel, the mean over pixels, the sum over layers.
Pictures go in with colours of −1 to 1; the network's own normalisation, which is that of ImageNet,
says the same of colours of 0 to 1.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from ico3d.common.unpacking.heads import check_head
from ico3d.common.weights import model_file
from ico3d.errors import MissingModelError, ModelError
from ico3d.head.perceptual import DEVIATION, MEAN, vgg_layers
from ico3d.head.perceptual import WEIGHTS as VGG_WEIGHTS
from ico3d.splat.device import CPU

Network = Literal["vgg", "alex"]
"""Networks with learnt channel weights: LPIPS of one cannot be compared with that of the other."""

VGG_CHANNELS = (64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512)
"""Output channels of VGG-16's convolutions; 0 stands for a max pooling."""

LEAST_SIDE = 32
"""Shortest side in pixels of a picture that keeps a pixel in all layers of both networks."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Files:
    """Where the weights of a network are, and which of its layers are compared.

    Attributes:
        features: File of the convolutions under torchvision's names (`features.0.weight` …).
        linear: File of the learnt channel weights, (1, C, 1, 1) each, under the names of version
            0.1 of the authors' package: `lin0.model.1.weight` … `lin4.model.1.weight`.
        taps: The layers whose outputs are compared: the last ReLU before each pooling of VGG-16,
            all ReLUs of AlexNet.
    """

    features: str
    linear: str
    taps: tuple[int, ...]


FILES: dict[Network, Files] = {
    "vgg": Files(VGG_WEIGHTS, "lpips_vgg.safetensors", (3, 8, 15, 22, 29)),
    "alex": Files("alexnet.safetensors", "lpips_alex.safetensors", (1, 4, 7, 9, 11)),
}


class Lpips(nn.Module):
    """Distance of two pictures in a network's features, with a learnt weight for each channel."""

    def __init__(self, network: Network):
        """Loads the weights.

        Raises:
            MissingModelError: If a file is not installed.
            ModelError: If a file does not hold these weights.
        """
        super().__init__()
        files = FILES[network]
        paths = [model_file(name, "LPIPS") for name in (files.features, files.linear)]
        self._taps = files.taps
        self.features = vgg_layers(VGG_CHANNELS) if network == "vgg" else _alexnet_layers()
        try:
            for path in paths:
                check_head(path)
            tensors, linear = map(load_file, paths)
            names = self.features.state_dict(prefix="features.")
            self.load_state_dict({name: tensors[name] for name in names})
            weights = [linear[f"lin{k}.model.1.weight"].flatten() for k in range(len(files.taps))]
        except (KeyError, RuntimeError, ValueError) as error:
            raise ModelError(
                f"{paths[0]} and {paths[1]} do not hold the weights of LPIPS: {error}."
            ) from error
        self.linear = nn.ParameterList(weights)  # (C,) each
        self.requires_grad_(False)

    @torch.no_grad()
    def forward(self, image: Tensor, target: Tensor) -> float:
        """The distance of two pictures (H, W, 3) in [0, 1]; 0 for equal ones."""
        pair = torch.stack([image, target])  # (2, H, W, 3)
        values = (pair - pair.new_tensor(MEAN)) / pair.new_tensor(DEVIATION)
        values = values.permute(0, 3, 1, 2)  # (2, 3, H, W)
        total = 0.0
        for index, layer in enumerate(self.features):
            values = layer(values)
            if index in self._taps:
                unit = values / (values.norm(dim=1, keepdim=True) + 1e-10)  # (2, C, h, w)
                squares = (unit[0] - unit[1]).square().mean((1, 2))  # (C,)
                total += float(self.linear[self._taps.index(index)] @ squares)
        return total


def _alexnet_layers() -> nn.Sequential:
    """AlexNet's convolutions as torchvision has and numbers them (Krizhevsky 2014)."""
    return nn.Sequential(
        *(nn.Conv2d(3, 64, 11, stride=4, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2)),
        *(nn.Conv2d(64, 192, 5, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2)),
        *(nn.Conv2d(192, 384, 3, padding=1), nn.ReLU()),
        *(nn.Conv2d(384, 256, 3, padding=1), nn.ReLU()),
        *(nn.Conv2d(256, 256, 3, padding=1), nn.ReLU()),
    )


@cache
def _installed(network: Network, device: torch.device) -> Callable[[Tensor, Tensor], float] | None:
    """LPIPS on a device, or None after one warning."""
    try:
        return Lpips(network).to(device)
    except MissingModelError as error:
        log.warning("measuring goes on without LPIPS (%s): %s", network, error)
        return None


def lpips(
    predicted: np.ndarray,
    truth: np.ndarray,
    network: Network = "vgg",
    device: torch.device = CPU,
) -> float | None:
    """LPIPS of two pictures.

    Args:
        predicted: (H, W, 3) in [0, 1].
        truth: (H, W, 3) in [0, 1].
        network: The network whose features are compared.
        device: Device to compute on.

    Returns:
        The distance; None if the weights are not installed, with one warning, or if a side has
        fewer than `LEAST_SIDE` pixels.
    """
    measure = _installed(network, device)
    if measure is None or min(truth.shape[:2]) < LEAST_SIDE:
        return None
    pair = (torch.from_numpy(picture).float().to(device) for picture in (predicted, truth))
    return measure(*pair)
