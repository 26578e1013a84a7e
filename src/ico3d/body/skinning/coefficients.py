"""How much of each residual shape a pose has: a small network, and poses it never saw."""

import math

import torch
from torch import Tensor

from ico3d.body.skinning.kinematics import unit

LAYERS = ("weight0", "bias0", "weight1", "bias1")
"""Tensors of the network: (3·J, H), (H,), (H, K), (K,)."""
NEAREST = 2.0
"""Width of the kernel, in distances from a pose to the nearest trained one, their median."""
FARTHER = 0.5
"""Of the distance to the nearest trained pose, by which the kernel is wider: a pose unlike all of
them has a mean of several, not the cast shadows of the nearest one alone."""


def features(rotations: Tensor) -> Tensor:
    """(..., 3·J) what the network knows of a pose: sin(angle / 2) times each joint's axis.

    Args:
        rotations: (..., J, 4) wxyz of each joint about itself, need not be normalised.
    """
    return unit(rotations)[..., 1:].flatten(-2)


def initial_network(
    rotations: Tensor, hidden: int, shapes: int, generator: torch.Generator
) -> dict[str, Tensor]:
    """Random weights by which the poses of a clip (F, J, 4) give coefficients about 0."""
    seen = features(rotations)  # (F, 3·J)
    spread = float(seen.var(0, unbiased=False).sum().sqrt())
    first = torch.randn(seen.shape[1], hidden, generator=generator) / max(spread, 1e-3)
    second = torch.randn(hidden, shapes, generator=generator) / math.sqrt(hidden)
    return {
        "weight0": first,
        "bias0": -seen.mean(0) @ first,
        "weight1": second,
        "bias1": torch.zeros(shapes),
    }


def network(weights: dict[str, Tensor], rotations: Tensor) -> Tensor:
    """(..., K) coefficients of poses (..., J, 4): affine, tanh, affine."""
    hidden = torch.tanh(features(rotations) @ weights["weight0"] + weights["bias0"])  # (..., H)
    return hidden @ weights["weight1"] + weights["bias1"]


def interpolated(known: Tensor, coefficients: Tensor, rotations: Tensor) -> Tensor:
    """Coefficients of a pose that was not trained, as a mean of those of poses like it.

    The network would leave the range in which it was trained; a weighted mean (Nadaraya-Watson,
    Gaussian kernel) cannot.

    Args:
        known: (F, J, 4) trained poses.
        coefficients: (F, K) theirs.
        rotations: (J, 4) the new pose.

    Returns:
        (K,).
    """
    places, place = features(known), features(rotations)  # (F, 3·J), (3·J,)
    between = torch.cdist(places, places)  # (F, F)
    between.fill_diagonal_(math.inf)
    width = NEAREST * between.amin(1).median() if len(known) > 1 else place.new_ones(())
    away = (places - place).square().sum(1)  # (F,)
    square = width.clamp_min(1e-6).square() + FARTHER**2 * away.min()
    return torch.softmax(-away / (2 * square), 0) @ coefficients
