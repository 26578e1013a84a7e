"""How much rendered pictures depend on each logit of a head, and on each Gaussian of a body."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import torch

from ico3d.common.camera import Camera
from ico3d.head.model import HeadModel
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

_FLOOR = 0.02
"""Least importance, relative to the mean: what no view shows must still look right."""
_STILL = ("means", "quats", "scales", "colors")
"""Properties that get no gradient when opacities are probed."""


def logit_importance(
    model: HeadModel,
    expressions: torch.Tensor,
    cameras: Sequence[Camera],
    background: torch.Tensor,
    seed: int,
) -> np.ndarray:
    """Root mean square change of the picture per unit change of each logit.

    Hutchinson's estimate: for a picture v of random signs, the squared gradient of <v, image> is in
    expectation the diagonal of JᵀJ, where J is the Jacobian of the image.

    Args:
        model: The exact head.
        expressions: (P, B) expression of each probe.
        cameras: P cameras in canonical head space.
        background: (3,) colour.
        seed: Seed of the signs.

    Returns:
        (N, 4) float32, scaled to mean 1 and then raised to `_FLOOR` where less.
    """
    generator = torch.Generator().manual_seed(seed)
    total = torch.zeros(len(model), 4, device=model.device)
    for expression, camera in zip(expressions, cameras, strict=True):
        with torch.no_grad():
            logits = model.logits(expression)
        logits.requires_grad_(True)
        gaussians = model.gaussians(logits, model.moves(expression))
        still = (gaussians.means, gaussians.quats, gaussians.scales)
        gaussians.means, gaussians.quats, gaussians.scales = (part.detach() for part in still)
        image = render(gaussians, [camera], background).rgb[0]  # (H, W, 3)
        (gradient,) = torch.autograd.grad((image * _signs(image, generator)).sum(), logits)
        total += gradient.square()
    importance = (total / len(cameras)).sqrt().cpu().numpy()  # (N, 4)
    importance /= max(float(importance.mean()), 1e-12)
    return np.maximum(importance, _FLOOR).astype(np.float32)


def gaussian_importance(
    drawn: Iterable[tuple[Gaussians, Camera]], background: torch.Tensor, seed: int
) -> np.ndarray:
    """Root mean square change of the picture if a Gaussian is left out, to first order.

    Hutchinson's estimate as in `logit_importance`, with gradients of opacities.

    Args:
        drawn: Pairs of the N Gaussians in some pose and a camera that sees them.
        background: (3,) colour.
        seed: Seed of the signs.

    Returns:
        (N,) float32.
    """
    generator = torch.Generator().manual_seed(seed)
    squares: list[torch.Tensor] = []
    for gaussians, camera in drawn:
        opacities = gaussians.opacities.detach().requires_grad_(True)
        still = {name: getattr(gaussians, name).detach() for name in _STILL}
        shown = replace(gaussians, opacities=opacities, **still)
        image = render(shown, [camera], background.to(opacities.device)).rgb[0]  # (H, W, 3)
        (gradient,) = torch.autograd.grad((image * _signs(image, generator)).sum(), opacities)
        squares.append((gradient * opacities.detach()).square())
    return torch.stack(squares).mean(0).sqrt().cpu().numpy()  # (N,)


def _signs(image: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Random 1 and −1 in the shape of a picture."""
    return (torch.randint(0, 2, image.shape, generator=generator) * 2 - 1).to(image)
