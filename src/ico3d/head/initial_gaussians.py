"""The initial Gaussians of a head."""

import logging
from collections.abc import Sequence

import numpy as np
import torch

from ico3d.capture.capture import Capture
from ico3d.capture.face.canonical import canonical_landmarks
from ico3d.capture.face.region import MOUTH
from ico3d.capture.surface.coverage import Moment, find_gap
from ico3d.capture.surface.head import head_silhouettes
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.errors import CaptureError
from ico3d.head.blending.displacement import Displacement
from ico3d.head.model import HeadModel, HeadShape, Variant
from ico3d.head.portrait.shoulders import neck_of
from ico3d.head.settings import HeadSettings
from ico3d.head.views import view_of
from ico3d.splat.initial import in_pictures, resampled, spacing

FRAMES = 8
"""Number of training frames in which some camera must see a surface point."""
MOMENTS = 4
"""Number of training frames in which masks are compared with the surface points."""
NEAREST = 16
"""Number of neighbouring frames in which each camera's mask is looked for."""
REACH = 3.0
"""Distance, in spacings of the surface points, within which a point covers the surface."""
LEAST_POINTS = 4
"""Smallest number of surface points: a point's spacing is measured to its three nearest."""
LEAST_REACH = 0.01
"""Smallest distance in metres within which a point covers the surface, however dense the points."""

log = logging.getLogger(__name__)


def initial_head(
    capture: Capture,
    settings: HeadSettings,
    variant: Variant,
    expression_size: int,
    rng: np.random.Generator,
    displacement: Displacement | None = None,
) -> HeadModel:
    """A head with round Gaussians on the capture's surface points, as wide as the points' spacing.

    Surface points may miss parts of the person (a face model ends at the neck). Where the masks
    show such parts, Gaussians start on the visual hull; their share equals that of those pixels.

    Args:
        capture: The recording.
        settings: The number of Gaussians and the size of the network.
        variant: The model's variant.
        expression_size: B, the number of values of an expression.
        rng: Source of all random choices.
        displacement: How the face's landmarks move; None for Gaussians that stand still.

    Raises:
        CaptureError: If the capture has no surface points, or one is not finite.
    """
    surface = capture.head_points()
    if surface is None or len(surface) < LEAST_POINTS or not np.isfinite(surface).all():
        raise CaptureError(f"{capture.path} has no finite surface points to start from.")
    points = _whole_person(capture, surface, settings.initial.gaussians, rng)  # (N, 3)
    if settings.close_ups:
        points = _mouth_first(capture, points)
    widths = spacing(points)  # (N,)
    low, high = points.min(0), points.max(0)
    shape = HeadShape(
        expression_size=expression_size,
        variant=variant,
        features=settings.network.features,
        hidden=settings.network.hidden,
        frequencies=settings.network.frequencies,
        box_center=tuple(((low + high) / 2).tolist()),
        box_size=float((high - low).max() / 2),
        sh_degree=settings.sh_degree,
        turns=settings.turns and variant in ("full", "no-mlp") and capture.shows == "head",
        neck=neck_of(capture),
        displacements=0 if displacement is None else len(displacement.modes),
    )
    model = HeadModel(shape, len(points))
    model.means.data = torch.from_numpy(points).float()
    model.log_scales.data = torch.from_numpy(np.log(widths)).float()[:, None].repeat(1, 3)
    if displacement is not None:
        model.displacement_basis.data = torch.from_numpy(displacement.spread(points)).float()
    return model


def _mouth_first(capture: Capture, points: np.ndarray) -> np.ndarray:
    """The points (N, 3) by their distance from the mouth, where landmarks tell its place.

    What a close-up shows then lies side by side in the basis, which is read three times as fast as
    if it were scattered.
    """
    landmarks = canonical_landmarks(capture)
    if landmarks is None:
        return points
    away = np.linalg.norm(points - landmarks[MOUTH].mean(0), axis=1)  # (N,)
    return points[np.argsort(away, kind="stable")]


def _whole_person(
    capture: Capture, surface: np.ndarray, count: int, rng: np.random.Generator
) -> np.ndarray:
    """(count, 3) points on a surface (P, 3), and on what it leaves out of the person.

    Of a body's recording only the head is wanted, and nothing else is looked for.
    """
    train = capture.split.train
    looked, compared = spread(len(train), FRAMES), spread(len(train), MOMENTS)
    cameras = _cameras(capture, [train[place] for place in looked])
    moments = [] if capture.shows == "body" else _moments(capture, compared)
    surface = _in_sight(capture, np.asarray(surface, np.float64), cameras)  # (P', 3)
    reach = max(REACH * float(np.quantile(spacing(surface), 0.9)), LEAST_REACH)
    gap = find_gap(surface, moments, reach)
    if len(gap.points) < LEAST_POINTS:
        if gap.share:
            log.warning(
                "%s: the surface points leave out %.0f %% of the person, and the masks do not "
                "agree on where that is: what lies beyond the points will be blurred.",
                capture.path,
                100 * gap.share,
            )
        return resampled(surface, count, rng)
    log.info(
        "%s: the surface points leave out %.0f %% of the person, who begins there on the masks.",
        capture.path,
        100 * gap.share,
    )
    extra = round(gap.share * count)
    parts = [resampled(surface, count - extra, rng), resampled(gap.points, extra, rng)]
    return np.concatenate(parts)


def _cameras(capture: Capture, frames: Sequence[int]) -> list[Camera]:
    """Every camera in some frames, in canonical head space."""
    numbers = range(len(capture.cameras))
    return [view_of(capture, camera, frame).camera for frame in frames for camera in numbers]


def _moments(capture: Capture, places: Sequence[int]) -> list[Moment]:
    """What cameras saw of the person at these places among the training frames, in head space."""
    train, found = capture.split.train, []
    for place in places:
        first = min(max(place - NEAREST // 2, 0), max(len(train) - NEAREST, 0))
        seen = head_silhouettes(capture, train[place], train[first : first + NEAREST])
        if seen:
            found.append(seen)
    return found


def _in_sight(capture: Capture, points: np.ndarray, cameras: Sequence[Camera]) -> np.ndarray:
    """The points (P', 3) of (P, 3) that lie within some picture: others would never be trained."""
    inside = in_pictures(points, cameras).any(0)  # (P,)
    if inside.sum() < LEAST_POINTS:
        raise CaptureError(f"{capture.path}: no camera sees the surface points; check the poses.")
    return points[inside]
