"""The perceptual loss: distance of VGG-16 features (Johnson et al., cited by the paper)."""

from collections.abc import Sequence

import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from ico3d.common.unpacking.heads import check_head
from ico3d.common.weights import model_file
from ico3d.errors import ModelError

WEIGHTS = "vgg16.safetensors"
"""File of the convolutions of ImageNet VGG-16, with torchvision's names (`features.0.weight` …)."""

CHANNELS = (64, 64, 0, 128, 128, 0, 256, 256, 256)
"""Output channels of the layers up to relu3_3; 0 stands for a 2×2 max pooling."""

MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Mean and standard deviation of ImageNet's colours, with which VGG was trained."""

TAPS = (3, 8, 15)
"""Layers whose outputs are compared: relu1_2, relu2_2, relu3_3."""


class PerceptualLoss(nn.Module):
    """Mean squared difference of VGG-16 features at three depths."""

    def __init__(self):
        """Loads the weights.

        Raises:
            MissingModelError: If they are not installed.
            ModelError: If the file does not hold these weights.
        """
        super().__init__()
        path = model_file(WEIGHTS, "the perceptual loss")
        self.features = vgg_layers(CHANNELS)
        try:
            check_head(path)
            tensors = load_file(path)
            self.load_state_dict({name: tensors[name] for name in self.state_dict()})
        except (KeyError, RuntimeError, ValueError) as error:
            raise ModelError(f"{path} does not hold VGG-16 weights: {error}.") from error
        self.requires_grad_(False)

    def forward(self, image: Tensor, target: Tensor) -> Tensor:
        """The distance (a scalar) of two pictures (H, W, 3) in [0, 1]."""
        with (
            torch.no_grad()
        ):  # nothing learns from the target: its half of the backward pass is saved
            wanted = self._taps(target)
        pairs = zip(self._taps(image), wanted, strict=True)
        return torch.stack([nn.functional.mse_loss(ours, theirs) for ours, theirs in pairs]).sum()

    def _taps(self, picture: Tensor) -> list[Tensor]:
        """Features (1, C, H', W') of a picture (H, W, 3) at the depths that are compared."""
        values = (picture - picture.new_tensor(MEAN)) / picture.new_tensor(DEVIATION)
        values = values.permute(2, 0, 1)[None]  # (1, 3, H, W)
        found = []
        for index, layer in enumerate(self.features):
            values = layer(values)
            if index in TAPS:
                found.append(values)
        return found


def vgg_layers(channels_of: Sequence[int]) -> nn.Sequential:
    """Convolutions with ReLU, numbered as in torchvision; 0 channels stand for a max pooling."""
    layers: list[nn.Module] = []
    width = 3
    for channels in channels_of:
        if channels == 0:
            layers.append(nn.MaxPool2d(2))
            continue
        layers += [nn.Conv2d(width, channels, 3, padding=1), nn.ReLU()]
        width = channels
    return nn.Sequential(*layers)
