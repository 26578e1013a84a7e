"""Coefficients of the residual shapes in a pose: by a small network, or interpolated from poses."""

import math

import torch
from torch import Tensor

from ico3d.body.skinning.kinematics import unit
from ico3d.common.spread import spread
from ico3d.rig.pose_regression import MOST_KNOWN, PoseRegression, kernel_width

LAYERS = ("weight0", "bias0", "weight1", "bias1")
"""Names of the network's tensors: (3·J, H), (H,), (H, K) and (K,)."""


def features(rotations: Tensor) -> Tensor:
    """(..., 3·J) features of a pose: sin(angle / 2) times the axis of each joint's rotation.

    Args:
        rotations: (..., J, 4) local rotation of each joint, wxyz, not necessarily normalised.
    """
    return unit(rotations)[..., 1:].flatten(-2)


def initial_network(
    rotations: Tensor, hidden: int, shapes: int, generator: torch.Generator
) -> dict[str, Tensor]:
    """Random weights for which the coefficients of a clip's poses have a mean near 0.

    Args:
        rotations: (F, J, 4) poses of the clip, wxyz.
        hidden: H, width of the hidden layer.
        shapes: K, number of residual shapes.
        generator: Draws the weights.
    """
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
    """(..., K) coefficients of poses (..., J, 4): an affine layer, tanh, and an affine layer."""
    hidden = torch.tanh(features(rotations) @ weights["weight0"] + weights["bias0"])  # (..., H)
    return hidden @ weights["weight1"] + weights["bias1"]


def interpolated(known: Tensor, coefficients: Tensor, rotations: Tensor) -> Tensor:
    """Coefficients of a pose that was not trained, found from those of trained poses.

    The network could give values outside of the range that it was trained for; `PoseRegression`
    cannot.

    Args:
        known: (F, J, 4) trained poses, wxyz.
        coefficients: (F, K) coefficients of the trained poses.
        rotations: (J, 4) the new pose, wxyz.

    Returns:
        (K,) coefficients of the new pose.
    """
    some = spread(len(known), MOST_KNOWN)
    poses, values = (part[some].cpu().double().numpy() for part in (known, coefficients))
    regression = PoseRegression(poses, values, kernel_width(poses))
    return torch.from_numpy(regression.at(rotations.cpu().double().numpy())).to(coefficients)
