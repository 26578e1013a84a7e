"""Made-up weights of LPIPS."""

from pathlib import Path

import torch
from safetensors.torch import save_file

STAGES = ((64, 64), (128, 128), (256, 256, 256), (512, 512, 512), (512, 512, 512))


def write_vgg(path: Path) -> None:
    """Random weights of VGG-16 up to relu3_3, of a size that keeps that of features."""
    generator = torch.Generator().manual_seed(0)
    values, number, width = {}, 0, 3
    for widths in STAGES[:3]:
        for channels in widths:
            weight = torch.randn((channels, width, 3, 3), generator=generator)
            values[f"features.{number}.weight"] = weight * (2 / (9 * width)) ** 0.5
            values[f"features.{number}.bias"] = torch.zeros(channels)
            number, width = number + 2, channels
        number += 1  # the pooling
    save_file(values, path / "vgg16.safetensors")


def write_weights(path: Path) -> tuple[dict, dict]:
    """Random weights, under torchvision's and the authors' names."""
    generator = torch.Generator().manual_seed(0)
    vgg, linear, number, width = {}, {}, 0, 3
    for stage, widths in enumerate(STAGES):
        for channels in widths:
            size = (channels, width, 3, 3)
            vgg[f"features.{number}.weight"] = torch.randn(size, generator=generator) / width**0.5
            vgg[f"features.{number}.bias"] = 0.1 * torch.randn(channels, generator=generator)
            number, width = number + 2, channels
        number += 1  # the pooling
        name = f"lin{stage}.model.1.weight"
        linear[name] = torch.rand(1, width, 1, 1, generator=generator)
    save_file(vgg, path / "vgg16.safetensors")
    save_file(linear, path / "lpips_vgg.safetensors")
    return vgg, linear


ALEXNET = (
    (0, 64, 3, 11, {"stride": 4, "padding": 2}),
    (3, 192, 64, 5, {"padding": 2}),
    (6, 384, 192, 3, {"padding": 1}),
    (8, 256, 384, 3, {"padding": 1}),
    (10, 256, 256, 3, {"padding": 1}),
)
"""AlexNet's convolutions: number, channels out and in, size, stride and padding."""


def write_alexnet(path: Path) -> tuple[dict, dict]:
    """Random weights of AlexNet, under torchvision's and the authors' names."""
    generator = torch.Generator().manual_seed(1)
    features, linear = {}, {}
    for stage, (number, out, width, size, _) in enumerate(ALEXNET):
        weight = torch.randn((out, width, size, size), generator=generator)
        features[f"features.{number}.weight"] = weight / (size * width**0.5)
        features[f"features.{number}.bias"] = 0.1 * torch.randn(out, generator=generator)
        linear[f"lin{stage}.model.1.weight"] = torch.rand(1, out, 1, 1, generator=generator)
    save_file(features, path / "alexnet.safetensors")
    save_file(linear, path / "lpips_alex.safetensors")
    return features, linear
