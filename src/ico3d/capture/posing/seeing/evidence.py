"""Where the landmarks of a person are in space, frame by frame, and how surely."""

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
LEAST_CORE = 8
"""Of the twelve joints of arms and legs those that must be known to fit a frame."""
BODY_STRAY, HAND_STRAY = 0.012, 0.006
"""Metres by which triangulated points usually err."""
ANNOTATED_STRAY = 0.006
"""Metres by which annotated points usually err."""
DEPTH_STRAY = 0.08
"""Metres by which one camera errs about depths."""
IN_HANDS = np.isin(np.arange(len(NAMES)), np.concatenate(HANDS))


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a recording says about a person's landmarks.

    Attributes:
        points: (F, P, 3) metres; 0 where unknown.
        roots: (F, P, 3, 3) square roots of their information; 0 where unknown.
        outlines: Of the person.
        source: Where the points come from, for people.
        detected: Whether the points are a detector's, not annotated.
    """

    points: np.ndarray
    roots: np.ndarray
    outlines: Outlines
    source: str
    detected: bool

    @property
    def fitted(self) -> np.ndarray:
        """(F,) bool: frames that say enough for a pose."""
        known = np.asarray(self.roots.any((2, 3)))  # (F, P)
        return known[:, TORSO].all(1) & (known[:, CORE].sum(1) >= LEAST_CORE)


def annotated(capture: Capture, watcher: Watcher) -> Evidence | None:
    """What annotators of the recording say; None where they say nothing."""
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
    """What MediaPipe sees in the pictures.

    Raises:
        CaptureError: If it sees nobody, or no two cameras agree in any frame.
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


def _nobody(seen: Seen) -> str:
    """Why no frame has a body, in words."""
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
            f"cameras in one frame; cameras {', '.join(blind)} see nobody"
        )
    return (
        f"people are found in {int(views.sum())} of {looked} pictures, but in no frame do two "
        "cameras agree on where; are the calibration and its scale (metres) right, and do the "
        "cameras run in step?"
    ).rstrip("?")


def _by_one(watcher: Watcher) -> Evidence:
    """What a single camera says: much across its view, little about depth."""
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
    """(3,) where points (N, 3) must be moved to be seen at pixels (N, 2) (least squares)."""
    rays = _rays(camera, pixels)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    across = np.eye(3) - rays[:, :, None] * rays[:, None]  # (N, 3, 3) off the ray
    off = camera.camera_to_world[:3, 3] - relative  # (N, 3)
    normal = np.einsum("nab,n->ab", across, weights)
    return np.linalg.solve(normal, np.einsum("nab,nb,n->a", across, off, weights))


def _rays(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """(N, 3) ways in the world that lead 1 m deep."""
    flat = (pixels - camera.intrinsics[:2, 2]) / camera.intrinsics[[0, 1], [0, 1]]
    local = np.append(flat, np.ones((len(flat), 1)), 1)
    return local @ camera.world_to_camera[:3, :3]


def _flat(rays: np.ndarray, stray: np.ndarray) -> np.ndarray:
    """(N, 3, 3) square roots of information: sure across rays, unsure along them."""
    along = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    outer = along[:, :, None] * along[:, None]
    return (np.eye(3) - outer) / stray[:, None, None] + outer / DEPTH_STRAY


def _evidence(
    points: np.ndarray, stray: np.ndarray, seen: Seen, source: str, by_detector: bool
) -> Evidence:
    """Evidence of points (F, P, 3), NaN where unknown, that err alike in all directions."""
    known = np.isfinite(points).all(-1)
    roots = np.where(known, 1 / stray, 0.0)[..., None, None] * np.eye(3)
    return Evidence(np.nan_to_num(points), roots, seen.outlines, source, by_detector)
