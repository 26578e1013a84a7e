"""The mean landmarks of a face in canonical head space."""

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.common.spread import spread

MOST_FRAMES = 60
"""Number of frames that are used, spread evenly over the capture."""
LEAST_RAYS = 2


def canonical_landmarks(capture: Capture) -> np.ndarray | None:
    """(68, 3) mean landmarks in canonical head space, metres; None if a capture has none.

    The landmarks are 3D landmarks where the format has them. Otherwise they are triangulated from
    2D landmarks of all cameras and frames at once, which head poses bring into one space.
    """
    frames = spread(capture.num_frames, MOST_FRAMES)
    given = [capture.landmarks_3d(frame) for frame in frames]
    known = [points for points in given if points is not None and np.isfinite(points).all()]
    if known:
        return np.mean(known, axis=0)
    return _triangulated(capture, frames)


def _triangulated(capture: Capture, frames: list[int]) -> np.ndarray | None:
    """Nearest points (68, 3) to the rays of all views."""
    normal, right, rays = np.zeros((68, 3, 3)), np.zeros((68, 3)), 0
    for frame in frames:
        some = rays_to_landmarks(capture, frame)
        normal, right, rays = normal + some[0], right + some[1], rays + some[2]
    if rays < LEAST_RAYS or np.linalg.cond(normal).max() > 1e8:
        return None
    return np.linalg.solve(normal, right[..., None])[..., 0]


def rays_to_landmarks(capture: Capture, frame: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Equations of the points that are nearest to the rays of a frame's 2D landmarks.

    Returns:
        Matrices (68, 3, 3) and right sides (68, 3) of landmarks in canonical head space, metres,
        and the number of cameras that gave rays; all 0 where none did.
    """
    normal, right, rays = np.zeros((68, 3, 3)), np.zeros((68, 3)), 0
    pose = capture.world_from_head(frame)
    if pose is None or not np.isfinite(pose).all():
        return normal, right, rays
    for index, camera in enumerate(capture.cameras):
        pixels = capture.landmarks(index, frame)
        if pixels is None or not np.isfinite(pixels).all():
            continue
        seen = camera.moved(pose)
        eye, directions = seen.camera_to_world[:3, 3], _directions(seen, pixels)
        across = np.eye(3) - directions[:, :, None] * directions[:, None]  # (68, 3, 3)
        normal, right, rays = normal + across, right + across @ eye, rays + 1
    return normal, right, rays


def _directions(camera, pixels: np.ndarray) -> np.ndarray:
    """(P, 3) unit directions of the rays through pixels (P, 2)."""
    ends = np.concatenate([pixels, np.ones((len(pixels), 1))], 1)  # (P, 3)
    rays = ends @ np.linalg.inv(camera.intrinsics).T @ camera.world_to_camera[:3, :3]  # (P, 3)
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)
