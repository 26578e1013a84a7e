"""A tiny capture of something that stands still, made from Gaussians."""

from pathlib import Path

import numpy as np
import torch

from ico3d.capture.capture import Capture, Split
from ico3d.common.camera import Camera, look_at
from ico3d.splat.gaussians import Gaussians
from support.photograph import photograph

SIZE, POINTS = 32, 150
PLATE = 0.25


class Still(Capture):
    """A shell of Gaussians before a grey wall, seen from cameras on an arc.

    With several frames the shell moves sideways, as its head pose says.
    """

    kind = "still"
    fps = 25.0

    def __init__(self, path: Path, cameras: int = 2, frames: int = 1, test: int = 0):
        self.path, self.num_frames = path, frames
        numbers = tuple(range(frames))
        self.split = Split(numbers[: frames - test], numbers[frames - test :])
        intrinsics = np.array([[40.0, 0, SIZE / 2], [0, 40.0, SIZE / 2], [0, 0, 1]])
        turns = np.linspace(-0.8, 0.8, cameras)
        self.cameras = tuple(
            Camera(
                SIZE,
                SIZE,
                intrinsics,
                look_at([np.sin(turn), 0.2, np.cos(turn)], np.zeros(3)),
                f"c{number}",
            )
            for number, turn in enumerate(turns)
        )
        rng = np.random.default_rng(0)
        directions = rng.normal(size=(POINTS, 3))
        self.surface = 0.2 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        self.colors = rng.random((POINTS, 3))

    def head_points(self, frame=0):
        return self.surface

    def world_from_head(self, frame):
        pose = np.eye(4)
        pose[0, 3] = 0.1 * frame
        return pose

    def background(self, camera):
        return np.full((SIZE, SIZE, 3), PLATE, np.float32)

    def image(self, camera, frame):
        return self._render(camera, frame)[0].clip(0, 1)

    def mask(self, camera, frame):
        return self._render(camera, frame)[1]

    def _render(self, camera, frame):
        gaussians = Gaussians(
            means=torch.from_numpy(self.surface).float(),
            quats=torch.tensor([1.0, 0, 0, 0]).repeat(POINTS, 1),
            scales=torch.full((POINTS, 3), 0.03),
            opacities=torch.full((POINTS,), 0.9),
            colors=torch.from_numpy(self.colors).float(),
        )
        view = self.cameras[camera].moved(self.world_from_head(frame))
        return photograph(gaussians, view, torch.full((3,), PLATE))
