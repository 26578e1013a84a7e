"""The Gaussians a head starts with."""

import numpy as np
import torch

from ico3d.capture.capture import Capture
from ico3d.errors import CaptureError
from ico3d.head.model import HeadModel, HeadShape, Variant
from ico3d.head.settings import HeadSettings
from ico3d.head.views import view_of
from ico3d.splat.initial import in_pictures, resampled, spacing


def initial_head(
    capture: Capture,
    settings: HeadSettings,
    variant: Variant,
    expression_size: int,
    rng: np.random.Generator,
) -> HeadModel:
    """A head on the capture's surface points, round Gaussians as wide as their spacing.

    Raises:
        CaptureError: If the capture has no surface points or one is not finite.
    """
    surface = capture.points()
    if surface is None or len(surface) < 4 or not np.isfinite(surface).all():
        raise CaptureError(f"{capture.path} has no finite surface points to start from.")
    seen = _seen(capture, np.asarray(surface, np.float64))  # (P', 3)
    points = resampled(seen, settings.initial_gaussians, rng)  # (N, 3)
    low, high = points.min(0), points.max(0)
    shape = HeadShape(
        expression_size=expression_size,
        variant=variant,
        features=settings.features,
        hidden=settings.hidden,
        frequencies=settings.frequencies,
        box_center=tuple(((low + high) / 2).tolist()),
        box_size=float((high - low).max() / 2),
    )
    model = HeadModel(shape, len(points))
    model.means.data = torch.from_numpy(points).float()
    model.log_scales.data = torch.from_numpy(np.log(spacing(points))).float()[:, None].repeat(1, 3)
    return model


def _seen(capture: Capture, points: np.ndarray) -> np.ndarray:
    """The points (P', 3) of (P, 3) that lie within some picture: others would never be trained."""
    frames = capture.split.train[:: max(1, len(capture.split.train) // 8)]
    cameras = [
        view_of(capture, index, frame).camera
        for frame in frames
        for index in range(len(capture.cameras))
    ]
    inside = in_pictures(points, cameras).any(0)  # (P,)
    if inside.sum() < 4:
        raise CaptureError(f"{capture.path}: no camera sees the surface points; check the poses.")
    return points[inside]
