"""First points of a window's Gaussians: on the best surface that the capture can give."""

import logging
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from ico3d.body.settings import Source
from ico3d.capture.capture import Capture
from ico3d.capture.pictures import train_cameras
from ico3d.capture.surface.coverage import HIDING, visible
from ico3d.capture.surface.hull import Silhouette, looked_at, visual_hull
from ico3d.common.camera import Camera
from ico3d.errors import CaptureError
from ico3d.splat.initial import in_pictures, resampled, spacing

HULL_EDGE = 0.02
"""Edge of the visual hull's voxels, metres."""
FEWEST = 4
"""Least number of points of a surface."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Start:
    """Points on which Gaussians begin.

    Attributes:
        points: (P, 3) positions in the world, metres.
        source: Where the points come from, in words.
    """

    points: np.ndarray
    source: str


def initial_points(
    capture: Capture,
    frame: int,
    count: int,
    rng: np.random.Generator,
    source: Source = "best",
) -> Start:
    """Points on the person's surface at one frame, from the best source that the capture has.

    Sources are, best first: the capture's own points (such as a body model's vertices), the visual
    hull of the training cameras' masks, and random places that these cameras look at.

    Args:
        capture: A recording of a body.
        frame: Index of the frame.
        count: Number of points.
        rng: Chooses the points.
        source: "best", or "hull" to leave out the capture's own points.

    Raises:
        CaptureError: If there is no other source and the cameras look at no common place.
    """
    known = _surface(capture, frame) if source == "best" else None
    start = known or _hull(capture, frame) or _anywhere(capture, count, rng)
    logger.info("%s, frame %d: Gaussians begin on %s.", capture.path, frame, start.source)
    return Start(resampled(start.points, count, rng), start.source)


def _surface(capture: Capture, frame: int) -> Start | None:
    """The capture's own points in view of some training camera; None if there are too few."""
    points = capture.world_points(frame)
    if points is None or not np.isfinite(points).all():
        return None
    cameras = [capture.cameras[index] for index in train_cameras(capture)]
    points = np.asarray(points, np.float64)
    points = points[in_pictures(points, cameras).any(0)]  # (P', 3)
    return Start(points, "the capture's surface points") if len(points) >= FEWEST else None


def _hull(capture: Capture, frame: int) -> Start | None:
    """Points of the visual hull of the training cameras' masks; None if there is none."""
    indices, seen = [], []
    for index in train_cameras(capture):
        mask = capture.mask(index, frame)
        if mask is not None:
            indices.append(index)
            seen.append(Silhouette.of(capture.cameras[index], mask))
    hull = visual_hull(seen, HULL_EDGE)
    if hull is None or len(hull.surface) < FEWEST:
        return None
    source = f"the visual hull of {len(seen) - len(hull.ignored)} masks"
    if hull.ignored:
        names = ", ".join(capture.cameras[indices[index]].name for index in hull.ignored)
        source += f" (ignored, as it contradicts the others: camera {names})"
    return Start(hull.surface, source)


def _anywhere(capture: Capture, count: int, rng: np.random.Generator) -> Start:
    """Random points in the ball that all training cameras look at.

    Raises:
        CaptureError: If there is no such ball.
    """
    box = looked_at([capture.cameras[index] for index in train_cameras(capture)])
    if box is None:
        raise CaptureError(
            f"{capture.path} has no surface points, no masks that agree, and no cameras that look "
            "at one place from different sides: a body cannot be placed in depth."
        )
    directions = rng.normal(size=(max(count, FEWEST), 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radii = box[1] * rng.random((len(directions), 1)) ** (1 / 3)
    return Start(box[0] + radii * directions, "random places before the cameras")


def point_colors(points: np.ndarray, capture: Capture, frame: int) -> np.ndarray:
    """Colours of surface points; one that is never seen takes that of the nearest seen one.

    Args:
        points: (P, 3) metres, in the world, spread over the surface at this frame.
        capture: The recording.
        frame: Index of the frame.

    Returns:
        (P, 3) float32 RGB in [0, 1]; grey where nothing is seen.
    """
    colors = seen_colors(points, capture, frame)  # (P, 3)
    known = np.isfinite(colors).any(1)  # (P,)
    if not known.any():
        return np.full((len(points), 3), 0.5, np.float32)
    return colors[known][KDTree(points[known]).query(points)[1]]


def seen_colors(points: np.ndarray, capture: Capture, frame: int) -> np.ndarray:
    """Colours of surface points: median over the training pictures in which they are seen.

    A point is seen where it projects onto the person and no other point lies clearly in front of
    it.

    Args:
        points: (P, 3) metres, in the world, spread over the surface at this frame.
        capture: The recording.
        frame: Index of the frame.

    Returns:
        (P, 3) float32 RGB in [0, 1]; NaN where a point is not seen.
    """
    gap = HIDING * float(np.quantile(spacing(points), 0.9))
    seen = np.full((0, len(points), 3), np.nan, np.float32)
    for index in train_cameras(capture):
        image = capture.image(index, frame)
        if image is None:
            continue
        camera = capture.cameras[index]
        pixels, inside = _on_person(points, camera, capture.mask(index, frame))
        inside &= visible(points, camera, gap)
        colors = np.full((1, len(points), 3), np.nan, np.float32)
        colors[0, inside] = image[pixels[inside, 1], pixels[inside, 0]]
        seen = np.concatenate([seen, colors])  # (V, P, 3)
    found = np.full((len(points), 3), np.nan, np.float32)
    known = np.isfinite(seen).any((0, 2))  # (P,)
    if known.any():
        found[known] = np.nanmedian(seen[:, known], axis=0)  # (K, 3)
    return found


def _on_person(
    points: np.ndarray, camera: Camera, mask: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (P, 2) int of points (P, 3) in the world, and (P,) bool whether they show the person.

    Without a mask all pixels in the picture count as the person's.
    """
    inside = in_pictures(points, [camera])[0]  # (P,)
    pixels = np.zeros((len(points), 2), int)
    pixels[inside] = camera.project(points[inside])[0].astype(int)
    if mask is not None:
        inside &= mask[pixels[:, 1], pixels[:, 0]] > 0.5
    return pixels, inside
