"""LPIPS with VGG-16 (Zhang et al. 2018), if its weights are installed."""

import logging
from collections.abc import Callable
from functools import cache

import numpy as np
import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from ico3d.common.weights import model_file
from ico3d.errors import MissingModelError, ModelError
from ico3d.head.perceptual import DEVIATION, MEAN, WEIGHTS, vgg_layers
from ico3d.splat.device import CPU

LINEAR = "lpips_vgg.safetensors"
"""File of the learnt channel weights, (1, C, 1, 1) each.

Names are those of version 0.1 of the authors' package: `lin0.model.1.weight` …
`lin4.model.1.weight`.
"""

CHANNELS = (64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512)
"""Output channels of VGG-16's convolutions; 0 stands for a max pooling."""

TAPS = (3, 8, 15, 22, 29)
"""Layers whose outputs are compared: relu1_2, relu2_2, relu3_3, relu4_3, relu5_3."""

log = logging.getLogger(__name__)


class Lpips(nn.Module):
    """Distance of two pictures in VGG-16's features, with a learnt weight for each channel."""

    def __init__(self):
        """Loads the weights.

        Raises:
            MissingModelError: If a file is not installed.
            ModelError: If a file does not hold these weights.
        """
        super().__init__()
        paths = [model_file(name, "LPIPS") for name in (WEIGHTS, LINEAR)]
        self.features = vgg_layers(CHANNELS)
        tensors, linear = map(load_file, paths)
        try:
            names = self.features.state_dict(prefix="features.")
            self.load_state_dict({name: tensors[name] for name in names})
            weights = [linear[f"lin{k}.model.1.weight"].flatten() for k in range(len(TAPS))]
        except (KeyError, RuntimeError) as error:
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
            if index in TAPS:
                unit = values / (values.norm(dim=1, keepdim=True) + 1e-10)  # (2, C, h, w)
                squares = (unit[0] - unit[1]).square().mean((1, 2))  # (C,)
                total += float(self.linear[TAPS.index(index)] @ squares)
        return total


@cache
def _installed(device: torch.device) -> Callable[[Tensor, Tensor], float] | None:
    """LPIPS on a device, or None after one warning."""
    try:
        return Lpips().to(device)
    except MissingModelError as error:
        log.warning("measuring goes on without LPIPS: %s", error)
        return None


def lpips(predicted: np.ndarray, truth: np.ndarray, device: torch.device = CPU) -> float | None:
    """LPIPS of two pictures; None if the weights are not installed.

    Args:
        predicted: (H, W, 3) in [0, 1].
        truth: (H, W, 3) in [0, 1].
        device: Device to compute on.
    """
    measure = _installed(device)
    if measure is None:
        return None
    pair = (torch.from_numpy(picture).float().to(device) for picture in (predicted, truth))
    return measure(*pair)
