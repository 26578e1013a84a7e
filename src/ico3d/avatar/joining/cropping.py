"""Crops a head model to the Gaussians that are drawn on a body."""

from dataclasses import replace

import numpy as np
import torch

from ico3d.capture.face.region import HeadRegion
from ico3d.errors import ModelError
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead


def cropped(head: TrainedHead, region: HeadRegion) -> TrainedHead:
    """The head with only those Gaussians whose centres lie in a region of its space.

    Raises:
        ModelError: If no Gaussian lies in the region.
    """
    means = head.model.means.detach().cpu().numpy().astype(np.float64)  # (N, 3)
    inside = (region.depth(means) > 0) & ~region.floating(means)  # (N,)
    keep = torch.nonzero(torch.from_numpy(inside))[:, 0]  # (K,)
    if len(keep) == 0:
        raise ModelError("no Gaussian of the head lies where its landmarks say that the face is.")
    return replace(head, model=_selected(head.model, keep))


def _selected(model: HeadModel, keep: torch.Tensor) -> HeadModel:
    """A copy of the model with the Gaussians of some indices (K,)."""
    chosen = HeadModel(model.shape, len(keep))
    values = dict(model.state_dict())
    for name, axis in model.gaussian_axes.items():
        values[name] = values[name].index_select(axis, keep.to(values[name].device))
    chosen.load_state_dict(values)
    return chosen


def near_border(head: TrainedHead, region: HeadRegion, reach: float) -> np.ndarray:
    """(P, 3) float64 positions of a head's Gaussians that lie near the border of a region.

    Args:
        head: The head before it is cropped, with Gaussians on both sides of the border.
        region: The part of the head that is drawn.
        reach: Largest distance to the border in metres, on either side.
    """
    means = head.model.means.detach().cpu().numpy().astype(np.float64)  # (N, 3)
    return means[np.abs(region.depth(means)) < reach]
