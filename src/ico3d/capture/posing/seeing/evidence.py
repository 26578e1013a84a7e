"""Positions of a person's landmarks in space in each frame, with their uncertainty."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.posing.model.naming import COCO_WHOLE_BODY
from ico3d.capture.posing.seeing.agreement import (
    CORE,
    HANDS,
    NAMES,
    Placed,
    agreed_body,
    agreed_hands,
)
from ico3d.capture.posing.seeing.outlines import Outlines
from ico3d.capture.posing.seeing.sightings import POSE, Seen, Watcher
from ico3d.common.camera import Camera
from ico3d.errors import CaptureError

TORSO = np.array([NAMES.index(f"{name}.{side}") for name in ("shoulder", "hip") for side in "LR"])
"""Indices of the landmarks of shoulders and hips."""
LEAST_CORE = 8
"""Least number of the twelve joints of arms and legs that must be known to fit a frame."""
BODY_STRAY, HAND_STRAY = 0.012, 0.006
"""Standard deviation in metres of triangulated points of the body, and of hands."""
ANNOTATED_STRAY = 0.006
"""Standard deviation in metres of annotated points."""
DEPTH_STRAY = 0.08
"""Standard deviation in metres of depths that a single camera tells."""
IN_HANDS = np.isin(np.arange(len(NAMES)), np.concatenate(HANDS))
"""(P,) bool: landmarks of hands."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence of a recording of F frames about a person.

    Attributes:
        points: (F, P, 3) positions of the landmarks in the world, metres; 0 where unknown.
        roots: (F, P, 3, 3) square roots of the positions' information matrices (1 / metres); 0
            where unknown.
        outlines: Outlines of the person.
        source: Where the points come from, in words.
        detected: Whether the points are from a detector; else they are annotated.
    """

    points: np.ndarray
    roots: np.ndarray
    outlines: Outlines
    source: str
    detected: bool

    @property
    def fitted(self) -> np.ndarray:
        """(F,) bool: frames in which enough landmarks are known to fit a pose."""
        known = np.asarray(self.roots.any((2, 3)))  # (F, P)
        return known[:, TORSO].all(1) & (known[:, CORE].sum(1) >= LEAST_CORE)


def annotated(capture: Capture, watcher: Watcher) -> Evidence | None:
    """Evidence from the recording's own key points; None where it has none.

    Args:
        capture: The recording.
        watcher: Reads the outlines.
    """
    points = np.full((capture.num_frames, len(NAMES), 3), np.nan)
    numbers = [NAMES.index(name) for name in COCO_WHOLE_BODY.values()]
    for frame in range(capture.num_frames):
        found = capture.whole_body_points(frame)
        if found is not None:
            points[frame, numbers] = found[list(COCO_WHOLE_BODY)]
    if np.isnan(points).all():
        return None
    watcher.look(bodies=False)
    stray = np.full(len(NAMES), ANNOTATED_STRAY)
    return _evidence(points, stray, watcher.seen, "the recording's own key points", False)


def detected(watcher: Watcher) -> Evidence:
    """Evidence from MediaPipe's detections in the pictures.

    Args:
        watcher: Reads pictures and outlines.

    Raises:
        CaptureError: If MediaPipe finds nobody, or no two cameras agree in any frame.
    """
    watcher.look(bodies=True)
    seen = watcher.seen
    if len(seen.cameras) == 1:
        return _by_one(watcher)
    bodies = [
        agreed_body(seen.cameras, pixels, weights)
        for pixels, weights in zip(seen.pixels, seen.weights, strict=True)
    ]
    if not any(bodies):
        raise CaptureError(f"{seen.capture.path}: {_nobody(seen)}; {INSTEAD}")
    points = np.full((len(bodies), len(NAMES), 3), np.nan)
    for frame, body in enumerate(bodies):
        seen.weights[frame] = 0
        if body is not None:
            seen.pixels[frame], seen.weights[frame] = body.pixels, body.weights
            points[frame] = body.points
    seen.weights[:, :, IN_HANDS] = 0
    watcher.look_at_hands(points)
    for frame, body in enumerate(bodies):
        if body is not None:
            whole = Placed(seen.pixels[frame], seen.weights[frame], points[frame])
            points[frame] = agreed_hands(seen.cameras, whole).points
    stray = np.where(IN_HANDS, HAND_STRAY, BODY_STRAY)
    count = len(seen.cameras)
    return _evidence(points, stray, seen, f"MediaPipe's points in {count} cameras", True)


INSTEAD = "ico3d train body --method swings++ needs no skeleton."
"""Advice at the end of error messages."""


def _nobody(seen: Seen) -> str:
    """Part of an error message: why no frame has a body."""
    views = np.asarray((seen.weights[..., CORE] > 0).all(-1))  # (F, C)
    looked = seen.weights.shape[0] * seen.weights.shape[1]
    if not views.any():
        return f"none of {looked} pictures shows a person whom MediaPipe finds"
    blind = [
        camera.name
        for camera, any_ in zip(seen.cameras, np.asarray(views.any(0)), strict=True)
        if not any_
    ]
    if (views.sum(1) < 2).all():
        return (
            f"a person is found in {int(views.sum())} of {looked} pictures, but never by two "
            "cameras in one frame" + (f"; cameras {', '.join(blind)} see nobody" if blind else "")
        )
    return (
        f"people are found in {int(views.sum())} of {looked} pictures, but in no frame do two "
        "cameras agree on where: check the calibration and its scale (metres), and whether the "
        "cameras run in step"
    )


def _by_one(watcher: Watcher) -> Evidence:
    """Evidence of a single camera: certain across the lines of sight, uncertain along them.

    Raises:
        CaptureError: If MediaPipe finds nobody.
    """
    seen = watcher.seen
    camera = seen.cameras[0]
    found = np.asarray((seen.weights[:, 0][:, CORE] > 0).all(1))  # (F,)
    if not found.any():
        raise CaptureError(f"{seen.capture.path}: {_nobody(seen)}; {INSTEAD}")
    points = np.full((len(found), len(NAMES), 3), np.nan)
    for frame in np.flatnonzero(found):
        relative = seen.relative[frame, 0].astype(float)  # (33, 3)
        place = _place(camera, relative, seen.pixels[frame, 0, POSE], seen.weights[frame, 0, POSE])
        points[frame, POSE] = relative + place
    seen.weights[:, :, IN_HANDS] = 0
    watcher.look_at_hands(points)
    roots = np.zeros((*points.shape, 3))
    for frame in np.flatnonzero(found):
        depths = camera.project(np.nan_to_num(points[frame]))[1]  # (P,)
        for hand, side in zip(HANDS, "LR", strict=True):
            depths[hand] = depths[NAMES.index(f"wrist.{side}")]
        rays = _rays(camera, seen.pixels[frame, 0])  # (P, 3), 1 m deep
        weights = seen.weights[frame, 0]
        points[frame] = camera.camera_to_world[:3, 3] + rays * depths[:, None]
        stray = np.where(IN_HANDS, HAND_STRAY, BODY_STRAY)
        roots[frame] = _flat(rays, stray) * np.sqrt(weights)[:, None, None]
    return Evidence(
        np.nan_to_num(points), roots, seen.outlines, "MediaPipe's points in one camera", True
    )


def _place(
    camera: Camera, relative: np.ndarray, pixels: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """(3,) translation of points with which they project to given pixels, by least squares.

    Args:
        camera: The camera.
        relative: (N, 3) points in the axes of the world, up to a translation, metres.
        pixels: (N, 2) pixels of the points.
        weights: (N,) weights of the points.
    """
    rays = _rays(camera, pixels)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    across = np.eye(3) - rays[:, :, None] * rays[:, None]  # (N, 3, 3) off the ray
    off = camera.camera_to_world[:3, 3] - relative  # (N, 3)
    normal = np.einsum("nab,n->ab", across, weights)
    return np.linalg.solve(normal, np.einsum("nab,nb,n->a", across, off, weights))


def _rays(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """(N, 3) vectors in the world from the camera to points of pixels (N, 2) at depth 1 m."""
    flat = (pixels - camera.intrinsics[:2, 2]) / camera.intrinsics[[0, 1], [0, 1]]
    local = np.append(flat, np.ones((len(flat), 1)), 1)
    return local @ camera.world_to_camera[:3, :3]


def _flat(rays: np.ndarray, stray: np.ndarray) -> np.ndarray:
    """(N, 3, 3) square roots of information matrices of points that a single camera sees.

    The standard deviation is `stray` (N,) across the rays (N, 3) and `DEPTH_STRAY` along them.
    """
    along = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    outer = along[:, :, None] * along[:, None]
    return (np.eye(3) - outer) / stray[:, None, None] + outer / DEPTH_STRAY


def _evidence(
    points: np.ndarray, stray: np.ndarray, seen: Seen, source: str, by_detector: bool
) -> Evidence:
    """Evidence of points with the same standard deviation in all directions.

    Args:
        points: (F, P, 3) metres; NaN where unknown.
        stray: (P,) standard deviations in metres.
        seen: What the cameras saw, for the outlines.
        source: Where the points come from, in words.
        by_detector: Whether the points are from a detector.
    """
    known = np.isfinite(points).all(-1)
    roots = np.where(known, 1 / stray, 0.0)[..., None, None] * np.eye(3)
    return Evidence(np.nan_to_num(points), roots, seen.outlines, source, by_detector)
