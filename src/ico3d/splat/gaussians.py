"""The Gaussian primitive: activated parameters, ready to render."""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass
class Gaussians:
    """N anisotropic 3D Gaussians with activated parameters.

    Attributes:
        means: (N, 3) metres.
        quats: (N, 4) rotations wxyz; need not be normalised.
        scales: (N, 3) standard deviations in metres, positive.
        opacities: (N,) in [0, 1].
        colors: (N, 3) RGB, or None where `sh` is given.
        sh: (N, K, 3) spherical harmonics, K = (degree + 1)², or None.
    """

    means: Tensor
    quats: Tensor
    scales: Tensor
    opacities: Tensor
    colors: Tensor | None = None
    sh: Tensor | None = None

    def __len__(self) -> int:
        """The number of Gaussians."""
        return self.means.shape[0]


__all__ = ["Gaussians", "torch"]
