"""A tiny body: a trunk and an arm of Gaussians that swings, seen by cameras all around."""

from pathlib import Path

import numpy as np
import torch

from ico3d.capture.capture import Capture, all_frames
from ico3d.common.camera import Camera, look_at
from ico3d.splat.gaussians import Gaussians
from support.photograph import photograph

HEIGHT, WIDTH, FRAMES, CAMERAS, POINTS = 40, 36, 9, 7, 500
_TAKEN: dict = {}


class MovingCapture(Capture):
    """Calm for the first half of the frames, then the arm rises by 70 degrees."""

    kind = "moving"
    shows = "body"
    fps = 15.0
    num_frames = FRAMES

    def __init__(self, path: Path):
        self.path = path
        intrinsics = np.array([[60.0, 0, WIDTH / 2 + 1], [0, 62.0, HEIGHT / 2], [0, 0, 1]])
        angles = 2 * np.pi * np.arange(CAMERAS) / CAMERAS
        eyes = [(2.2 * np.sin(a), 0.2 + 0.3 * np.cos(3 * a), 2.2 * np.cos(a)) for a in angles]
        self.cameras = tuple(
            Camera(WIDTH, HEIGHT, intrinsics, look_at(eye, (0, 0, 0)), f"c{number}")
            for number, eye in enumerate(eyes)
        )
        self.split = all_frames(FRAMES, self.cameras)
        rng = np.random.default_rng(0)
        ball = rng.normal(size=(POINTS, 3))
        ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        self.arm = np.arange(POINTS) >= POINTS // 2
        self._rest = np.where(
            self.arm[:, None],
            ball * (0.28, 0.06, 0.06) + (0.42, 0.2, 0),
            ball * (0.16, 0.45, 0.12),
        )
        self._colors = rng.random((POINTS, 3)) * 0.6 + 0.2

    def angle(self, frame: float) -> float:
        """How far the arm is up, radians."""
        return np.radians(70) * max(0.0, (frame - FRAMES // 2) / (FRAMES - 1 - FRAMES // 2))

    def world_points(self, frame=0):
        c, s = np.cos(self.angle(frame)), np.sin(self.angle(frame))
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        shoulder = np.array([0.14, 0.2, 0])
        turned = (self._rest - shoulder) @ turn.T + shoulder
        return np.where(self.arm[:, None], turned, self._rest)

    def background(self, camera):
        return np.full((HEIGHT, WIDTH, 3), 0.3 + 0.02 * camera, np.float32)

    def _drawn(self, camera, frame):
        """Picture and mask; many tests ask for the same ones."""
        lens = self.cameras[camera]
        places = lens.intrinsics.tobytes(), lens.world_to_camera.tobytes()
        key = camera, frame, lens.width, lens.height, *places
        if key not in _TAKEN:
            _TAKEN[key] = self._taken(camera, frame)
        return tuple(layer.copy() for layer in _TAKEN[key])

    def _taken(self, camera, frame):
        gaussians = Gaussians(
            torch.from_numpy(self.world_points(frame)).float(),
            torch.tensor([1.0, 0, 0, 0]).repeat(POINTS, 1),
            torch.full((POINTS, 3), 0.022),
            torch.full((POINTS,), 0.9),
            torch.from_numpy(self._colors).float(),
        )
        plate = torch.from_numpy(self.background(camera))
        return photograph(gaussians, self.cameras[camera], plate)

    def image(self, camera, frame):
        return self._drawn(camera, frame)[0]

    def mask(self, camera, frame):
        return self._drawn(camera, frame)[1]
