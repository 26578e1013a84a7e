"""How a baked avatar is presented: idle motion, the visitor's camera, background, thumbnail."""

import io
from dataclasses import dataclass

import numpy as np
import torch
from PIL import Image

from ico3d.avatar.render_bundle import visitor_camera
from ico3d.bundle.manifest import CameraInfo
from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

LONGEST = 10.0
"""Seconds of head motion in a bundle, at most."""
_ARM = 0.1
"""Distance in metres from the head's origin at which the speed of turning is measured."""
_SMOOTHING = 1.5
"""Standard deviation, in frames, of the smoothing of head poses (trackers jitter)."""
_MARGIN = 1.2
"""Size of the visitor's first picture as a multiple of the person's size in it."""
_BODY_FOV, _BODY_MARGIN = 30.0, 1.3
"""A body's visitor: vertical field of view in degrees, and size of the view over the body's.

The margin leaves room for the player's bar below the feet.
"""
_THUMBNAIL = 384
"""Width and height of the thumbnail in pixels."""
NEUTRAL = (0.84, 0.86, 0.88)
"""Background colour, a light grey, where the capture has no clean background."""


@dataclass(frozen=True)
class IdleMotion:
    """How a head alone sways.

    Attributes:
        poses: (F, 4, 4) float64 smoothed head poses at the capture's rate.
        first: The frame of the first pose.
    """

    poses: np.ndarray
    first: int


def idle_motion(capture: Capture) -> IdleMotion:
    """The span of head poses that looks best when it is played back and forth.

    Playback turns around at both ends, so the head should be slow there, and smooth in between.

    Returns:
        10 s at most; a single pose, the identity, where there are no poses.
    """
    poses, first = _longest_run([capture.world_from_head(f) for f in range(capture.num_frames)])
    if len(poses) == 0:
        return IdleMotion(np.eye(4)[None], 0)
    poses = smoothed(poses)
    length = min(len(poses), max(1, int(LONGEST * capture.fps)))
    starts = range(len(poses) - length + 1)
    best = min(starts, key=lambda start: _roughness(poses[start : start + length]))
    return IdleMotion(poses[best : best + length], first + best)


def frontal_camera(capture: Capture) -> int:
    """Index of the camera that sees the face most from the front, by symmetry of landmarks."""
    asymmetry = [_asymmetry(capture, camera) for camera in range(len(capture.cameras))]
    return int(np.argmin(asymmetry))


def visitor_view(camera: Camera, points: np.ndarray) -> CameraInfo:
    """The visitor's first camera: at the capture's camera, turned and zoomed to frame the person.

    Args:
        camera: The frontal camera, in world space.
        points: (P, 3) world positions of the visible Gaussians, metres.
    """
    pixels, depths = camera.project(points)  # (P, 2), (P,)
    inside = depths > 0
    low, high = np.percentile(pixels[inside], (0.5, 99.5), axis=0)  # (2,), (2,)
    size = np.array([camera.width, camera.height], float)
    low, high = np.clip(low, 0, size), np.clip(high, 0, size)
    centre, half = (low + high) / 2, (high - low).max() / 2 * _MARGIN
    half = min(max(half, 1.0), size[1] / 2)  # never taller than the recorded picture
    centre[1] = min(centre[1], size[1] - half)  # nor below its lower edge, where the person ends
    ray = np.linalg.inv(camera.intrinsics) @ [*centre, 1.0]
    rotation, eye = camera.world_to_camera[:3, :3], camera.camera_to_world[:3, 3]
    target = eye + rotation.T @ ray * np.median(depths[inside])
    fov = 2 * np.degrees(np.arctan(half / camera.intrinsics[1, 1]))
    return CameraInfo(triple(eye), triple(target), triple(-rotation[1]), round(float(fov), 3))


def background_colour(capture: Capture, camera: int) -> tuple[float, float, float]:
    """Mean RGB of a camera's clean background; a light grey where the capture has none."""
    picture = capture.background(camera)
    return NEUTRAL if picture is None else triple(picture.reshape(-1, 3).mean(axis=0))


def standing_view(
    low: np.ndarray, high: np.ndarray, up: np.ndarray, toward: np.ndarray
) -> CameraInfo:
    """The visitor's first camera before a body: level with its middle, with all of it in view.

    Args:
        low: (3,) least coordinates of the body's bounding box, metres.
        high: (3,) greatest coordinates of that box.
        up: (3,) upward direction, of length 1.
        toward: (3,) direction from the body to the visitor, of length 1.
    """
    middle = (low + high) / 2
    reach = np.linalg.norm(high - low) / 2 * _BODY_MARGIN
    eye = middle + toward * reach / np.tan(np.deg2rad(_BODY_FOV) / 2)
    return CameraInfo(triple(eye), triple(middle), triple(up), _BODY_FOV)


def thumbnail(
    gaussians: Gaussians, info: CameraInfo, background: tuple[float, float, float]
) -> bytes:
    """PNG file of what a visitor sees first.

    Args:
        gaussians: The person in the world.
        info: The visitor's first camera.
        background: RGB in [0, 1].
    """
    camera = visitor_camera(info, _THUMBNAIL, _THUMBNAIL)
    with torch.no_grad():
        picture = render(gaussians, [camera], torch.tensor(background)).rgb[0]  # (H, W, 3)
    buffer = io.BytesIO()
    Image.fromarray((picture.clamp(0, 1) * 255 + 0.5).byte().cpu().numpy()).save(buffer, "PNG")
    return buffer.getvalue()


def triple(values: np.ndarray) -> tuple[float, float, float]:
    """A vector (3,) as three numbers rounded to 5 decimals, for a manifest."""
    x, y, z = (round(float(value), 5) for value in values)
    return x, y, z


def _longest_run(poses: list[np.ndarray | None]) -> tuple[np.ndarray, int]:
    """Poses (F, 4, 4) of the longest run of frames that all have a finite one, and its first."""
    runs: list[tuple[list[np.ndarray], int]] = [([], 0)]
    for frame, pose in enumerate(poses):
        if pose is not None and np.isfinite(pose).all():
            runs[-1][0].append(pose)
        else:
            runs.append(([], frame + 1))
    longest, first = max(runs, key=lambda run: len(run[0]))
    return np.array(longest, np.float64).reshape(-1, 4, 4), first


def smoothed(poses: np.ndarray) -> np.ndarray:
    """Gaussian smoothing over time; rotations are averaged as matrices and made rigid again."""
    reach = int(3 * _SMOOTHING)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / _SMOOTHING) ** 2)
    padded = np.pad(poses, ((reach, reach), (0, 0), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, len(kernel), axis=0)  # (F, 4, 4, K)
    mean = windows @ (kernel / kernel.sum())  # (F, 4, 4)
    u, _, vt = np.linalg.svd(mean[:, :3, :3])
    mean[:, :3, :3] = u @ vt
    return mean


def _roughness(poses: np.ndarray) -> float:
    """How badly poses (F, 4, 4) play back and forth: end speeds plus four mean accelerations.

    Both are of points `_ARM` from the head's origin, in metres per frame and per frame².
    """
    if len(poses) < 3:
        return 0.0
    tips = poses[:, :3, 3:] + _ARM * poses[:, :3, :3]  # (F, 3, 3): ends of the three axes
    speed = np.linalg.norm(np.diff(tips, axis=0), axis=1).max(axis=1)  # (F − 1,)
    jerk = np.linalg.norm(np.diff(tips, 2, axis=0), axis=1).max(axis=1)  # (F − 2,)
    return float(speed[:2].mean() + speed[-2:].mean() + 4 * jerk.mean())


def _asymmetry(capture: Capture, camera: int) -> float:
    """How unequal the distances from the nose's tip to both jaw ends are in a camera's pictures.

    Mean over frames of |left − right| / (left + right): 0 from in front; 1 without landmarks.
    """
    values = []
    for frame in spread(capture.num_frames, 8):
        landmarks = capture.landmarks(camera, frame)
        if landmarks is not None and np.isfinite(landmarks).all():
            left, right = np.linalg.norm(landmarks[[0, 16]] - landmarks[30], axis=1)
            values.append(abs(left - right) / max(left + right, 1e-9))
    return float(np.mean(values)) if values else 1.0
