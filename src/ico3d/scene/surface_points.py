"""Initial positions of a scene's Gaussians: known surfaces, else estimates from the pictures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.pictures import View
from ico3d.capture.surface.hull import Silhouette, focus, looked_at, visual_hull
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.errors import CaptureError
from ico3d.scene.model import StaticScene, scene_on_points
from ico3d.scene.settings import SceneSettings
from ico3d.scene.views import SceneViews
from ico3d.splat.initial import in_pictures, resampled

SAMPLED_VIEWS = 24
"""Number of views that are examined; further ones add no information."""
HULL_VOXELS = 50
"""Voxels of the visual hull along half the width of the space that the pictures show."""
DEPTHS = 0.5, 6.0
"""Nearest and farthest background, as factors of the cameras' distance from their subject."""
CAMERA_MARGIN = 1.1
"""Factor of 3DGS between the spread of the cameras and the extent of the scene."""


@dataclass(frozen=True)
class Start:
    """The initial state of a scene's training.

    Attributes:
        scene: The initial Gaussians.
        extent: Size of the scene in metres, to which rates and thresholds are relative: half the
            edge of a person's bounding box, else the spread of the cameras.
    """

    scene: StaticScene
    extent: float


def initial_scene(
    capture: Capture, views: SceneViews, settings: SceneSettings, rng: np.random.Generator
) -> Start:
    """Gaussians on the person's surface, throughout the background, or both.

    The person's surface comes from the capture's surface points or, without any, from the volume
    that all masks agree on.

    Raises:
        CaptureError: If the capture has neither surface points nor other means to place Gaussians.
    """
    some = [views.train[place] for place in spread(len(views.train), SAMPLED_VIEWS)]
    initial = settings.initial
    count = min(initial.gaussians, settings.density.max_gaussians)
    surface = None if views.only == "background" else _surface(capture, views, some)
    if views.only == "person":
        surface = _hull(views, some) if surface is None else surface
        points = resampled(surface, count, rng)  # (N, 3)
        extent = float(np.ptp(points, axis=0).max() / 2)
    else:
        parts = [] if surface is None else [resampled(surface, count // 2, rng)]
        away = _reach(capture, some)
        parts.append(_in_front(some, count - sum(map(len, parts)), away, rng))
        points = np.concatenate(parts)
        extent = CAMERA_MARGIN * _camera_spread(some)
    colors = _colors(points, views, some)
    degree, opacity, scale = settings.sh_degree, initial.opacity, initial.scale
    return Start(scene_on_points(points, colors, degree, opacity, scale), extent)


def _surface(capture: Capture, views: SceneViews, some: Sequence[View]) -> np.ndarray | None:
    """(P, 3) the capture's points that some picture holds, in the scene's space."""
    frame = some[0].frame
    pose, points = capture.world_from_head(frame), capture.head_points()
    if points is None:
        points = capture.world_points(frame)
        pose = None if pose is None or views.space == "world" else np.linalg.inv(pose)
    elif views.space != "world":
        pose = None
    if points is None or not np.isfinite(points).all():
        return None
    points = np.asarray(points, np.float64)
    if pose is not None:
        points = points @ pose[:3, :3].T + pose[:3, 3]  # (P, 3)
    seen = points[in_pictures(points, [view.camera for view in some]).any(0)]
    return seen if len(seen) >= 4 else None


def _hull(views: SceneViews, some: Sequence[View]) -> np.ndarray:
    """(P, 3) points on the surface of what all masks agree on.

    Raises:
        CaptureError: If the person cannot be placed.
    """
    box = looked_at([view.camera for view in some])
    if box is None:
        raise CaptureError(
            f"{views.path} has neither surface points nor cameras that look at one place from "
            "different sides: a person cannot be placed in depth."
        )
    masks = [(view.camera, views.layers(view)[1]) for view in some]
    seen = [Silhouette.of(camera, mask.numpy()) for camera, mask in masks if mask is not None]
    hull = visual_hull(seen, box[1] / HULL_VOXELS)
    if hull is None or len(hull.surface) < 4:
        raise CaptureError(
            f"{views.path}: the masks of its cameras agree on no place where the person is: "
            "check cameras and masks with ico3d capture check."
        )
    return hull.surface


def _camera_spread(views: Sequence[View]) -> float:
    """Greatest distance of a camera from the middle of them all, metres."""
    centers = np.stack([view.camera.camera_to_world[:3, 3] for view in views])  # (C, 3)
    return float(np.linalg.norm(centers - centers.mean(0), axis=1).max())


def _reach(capture: Capture, some: Sequence[View]) -> float:
    """Metres from the cameras to what they look at; else twice their spread.

    Raises:
        CaptureError: If all cameras stand in one place.
    """
    apart = _camera_spread(some)
    if apart == 0:
        raise CaptureError(
            f"{capture.path}: all pictures were taken from one place: depth cannot be seen."
        )
    cameras = [view.camera for view in some]
    middle = focus(cameras)
    if middle is None:
        return 2 * apart
    depth = float(np.median([camera.project(middle)[1] for camera in cameras]))
    return depth if depth > 0 else 2 * apart


def _in_front(
    views: Sequence[View], count: int, away: float, rng: np.random.Generator
) -> np.ndarray:
    """(count, 3) points behind random pixels, at depths that are log-uniform around `away`."""
    nearest, farthest = np.log(DEPTHS)
    depths = away * np.exp(rng.uniform(nearest, farthest, count))  # (count,)
    chosen = rng.integers(len(views), size=count)
    points = np.empty((count, 3))
    for index, view in enumerate(views):
        camera, mine = view.camera, chosen == index
        pixels = rng.random((mine.sum(), 2)) * (camera.width, camera.height)
        homogeneous = np.concatenate([pixels, np.ones((len(pixels), 1))], 1)  # (P, 3)
        local = homogeneous @ np.linalg.inv(camera.intrinsics).T * depths[mine, None]  # (P, 3)
        pose = camera.camera_to_world
        points[mine] = local @ pose[:3, :3].T + pose[:3, 3]
    return points


def _colors(points: np.ndarray, views: SceneViews, some: Sequence[View]) -> np.ndarray:
    """(N, 3) mean colour of the pixels that points (N, 3) project to; grey where there is none."""
    total, seen = np.full((len(points), 3), 0.5), np.ones((len(points), 1))
    for view, held in zip(some, in_pictures(points, [v.camera for v in some]), strict=True):
        total[held] += _pixels(views.layers(view)[0].numpy(), points[held], view.camera)
        seen[held] += 1
    return total / seen


def _pixels(picture: np.ndarray, points: np.ndarray, camera: Camera) -> np.ndarray:
    """(P, ...) values of a picture (H, W, ...) where points (P, 3) lie in it."""
    column, row = camera.project(points)[0].T.astype(int)  # (P,) each
    return picture[row, column]
