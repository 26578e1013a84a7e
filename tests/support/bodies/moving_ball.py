"""A tiny analytic capture of a body: a textured ellipsoid beside one that stands still."""

from pathlib import Path

import numpy as np

from ico3d.capture.capture import Capture, all_frames
from ico3d.common.camera import Camera, look_at

WIDTH, HEIGHT = 144, 160
AXES = np.array([0.22, 0.6, 0.2])
"""Half axes of the trunk in metres; it stands around the origin."""
BALL = 0.16
"""Radius of what moves."""
PLATE = 0.2
_TAKEN: dict = {}


class MovingBall(Capture):
    """A still trunk and a ball beside it that rises as it is told, before a grey wall.

    The ball's centre is at (0.45, heights[frame], 0). Cameras stand on a ring of 3 m.
    """

    kind = "ball"
    fps = 15.0

    def __init__(self, path: Path, heights, cameras: int = 8):
        self.path, self.heights = path, heights
        self.num_frames = len(heights)
        intrinsics = np.array([[300.0, 0, WIDTH / 2], [0, 300.0, HEIGHT / 2], [0, 0, 1]])
        turns = np.arange(cameras) * 2 * np.pi / cameras
        self.cameras = tuple(
            Camera(
                WIDTH,
                HEIGHT,
                intrinsics,
                look_at([3 * np.sin(turn), 0.3, 3 * np.cos(turn)], np.zeros(3)),
                f"c{number}",
            )
            for number, turn in enumerate(turns)
        )
        self._lenses = self.cameras  # tests may change what the capture says
        self.split = all_frames(self.num_frames, self.cameras)
        self.asked: list[tuple[int, int]] = []

    def center(self, frame):
        return np.array([0.45, self.heights[frame], 0.0])

    def surface(self, frame, count=2000):
        """Exact points (2·count, 3) and their colours: first the trunk's, then the ball's."""
        directions = np.random.default_rng(5).normal(size=(count, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        trunk, ball = AXES * directions, BALL * directions
        return (
            np.concatenate([trunk, self.center(frame) + ball]),
            np.concatenate([_trunk_color(trunk), _ball_color(ball)]),
        )

    def image(self, camera, frame):
        self.asked.append((camera, frame))
        return self._trace(camera, frame)[0]

    def mask(self, camera, frame):
        return self._trace(camera, frame)[1]

    def _trace(self, camera, frame):
        return _picture(self._lenses[camera], tuple(self.center(frame)))


def _picture(view, center):
    """Picture and mask that a camera takes; many tests take the same ones."""
    key = (view.world_to_camera.tobytes(), center)
    if key not in _TAKEN:
        _TAKEN[key] = _taken(view, center)
    return tuple(layer.copy() for layer in _TAKEN[key])


def _taken(view, center):
    columns, rows = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    pixels = np.stack([columns, rows, np.ones_like(rows)], -1)  # (H, W, 3)
    pose = view.camera_to_world
    rays = pixels @ np.linalg.inv(view.intrinsics).T @ pose[:3, :3].T
    near_trunk, on_trunk = _hit(pose[:3, 3], rays, np.zeros(3), AXES)
    near_ball, on_ball = _hit(pose[:3, 3], rays, np.array(center), np.full(3, BALL))
    color = np.where(
        (near_trunk < near_ball)[..., None], _trunk_color(on_trunk), _ball_color(on_ball)
    )
    mask = np.isfinite(np.minimum(near_trunk, near_ball))
    return np.where(mask[..., None], color, PLATE).astype(np.float32), mask.astype(np.float32)


def _hit(eye, rays, center, axes):
    """How far along rays (H, W, 3) an ellipsoid is met, else infinite; where, from its centre."""
    start, ways = (eye - center) / axes, rays / axes
    a, b, c = (ways**2).sum(-1), (ways * start).sum(-1), (start**2).sum() - 1
    with np.errstate(invalid="ignore"):
        near = (-b - np.sqrt(b * b - a * c)) / a
    near = np.where(np.isfinite(near), near, np.inf)
    return near, (start + np.where(np.isfinite(near), near, 0)[..., None] * ways) * axes


def _trunk_color(points):
    """Blue and green waves."""
    waves = 0.5 + 0.4 * np.sin(25 * points)
    return np.stack([np.full(waves.shape[:-1], 0.1), waves[..., 1], waves[..., 0]], -1)


def _ball_color(points):
    """Red with a pattern."""
    waves = 0.5 + 0.4 * np.sin(40 * points[..., 0]) * np.sin(40 * points[..., 1])
    return np.stack([np.full(waves.shape, 0.9), waves * 0.5, waves * 0.2], -1)
