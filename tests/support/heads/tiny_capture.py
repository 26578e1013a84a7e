"""A tiny capture, made from Gaussians whose colours and opacities follow an expression."""

from pathlib import Path

import numpy as np
import torch

from ico3d.capture.capture import Capture, Sound, last_eleventh
from ico3d.common.camera import Camera, look_at
from ico3d.common.expression import EYE_NAMES
from ico3d.splat.gaussians import Gaussians
from support.photograph import photograph

SIZE, FRAMES, POINTS = 48, 44, 300


class TinyCapture(Capture):
    """A shell of 300 Gaussians; its lower half reddens, its upper half pales."""

    kind = "tiny"
    fps = 30.0
    num_frames = FRAMES
    blendshape_names = ("redden", "pale", "unused")

    def __init__(self, path: Path, size: int = SIZE):
        self.path, self._size = path, size
        self.split = last_eleventh(FRAMES)
        focal = 1.25 * size
        intrinsics = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]])
        eyes = ([0.0, 0.0, 1.0], [0.4, 0.1, 0.9])
        self.cameras = tuple(
            Camera(size, size, intrinsics, look_at(np.array(eye), np.zeros(3)), str(number))
            for number, eye in enumerate(eyes)
        )
        rng = np.random.default_rng(0)
        directions = rng.normal(size=(POINTS, 3))
        self._points = 0.2 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        self._colors = rng.random((POINTS, 3)) * 0.5 + 0.2
        times = np.arange(FRAMES) / self.fps
        self._weights = np.stack(
            [np.sin(9 * times) ** 2, np.cos(5 * times) ** 2, 0 * times], 1
        ).astype(np.float32)

    def head_points(self, frame=0):
        return self._points

    def blendshapes(self, frame):
        return self._weights[frame]

    def eyes(self, frame):
        return np.full(len(EYE_NAMES), 0.1 * (frame % 3), np.float32)

    def world_from_head(self, frame):
        return self._pose(frame)

    def _pose(self, frame):
        pose = np.eye(4)
        pose[0, 3] = 0.02 * np.sin(frame)
        return pose

    def background(self, camera):
        return np.full((self._size, self._size, 3), 0.5, np.float32)

    def audio(self):
        times = np.arange(int(16000 * FRAMES / self.fps)) / 16000
        return Sound((0.3 * np.sin(2 * np.pi * 300 * times)).astype(np.float32), 16000)

    def image(self, camera, frame):
        if frame % 2 != camera:
            return None
        return self._render(camera, frame, self.background(camera))[0]

    def mask(self, camera, frame):
        if frame % 2 != camera:
            return None
        return self._render(camera, frame, None)[1]

    def _render(self, camera, frame, background):
        colors = self._colors.copy()
        low = self._points[:, 1] < 0
        colors[low, 0] += 0.3 * self._weights[frame, 0]
        colors[~low] += 0.3 * self._weights[frame, 1]
        gaussians = Gaussians(
            means=torch.from_numpy(self._points).float(),
            quats=torch.tensor([1.0, 0, 0, 0]).repeat(POINTS, 1),
            scales=torch.full((POINTS, 3), 0.02),
            opacities=torch.full((POINTS,), 0.9),
            colors=torch.from_numpy(colors).float(),
        )
        behind = None if background is None else torch.from_numpy(background)
        view = self.cameras[camera].moved(self._pose(frame))
        return photograph(gaussians, view, behind)
