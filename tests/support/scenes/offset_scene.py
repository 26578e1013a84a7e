"""A small scene, and a capture whose pictures differ from it by a known error."""

import numpy as np
import torch

from ico3d.capture.capture import Capture, Split
from ico3d.common.camera import Camera, look_at
from ico3d.scene.model import scene_on_points
from ico3d.scene.model_folder import TrainedScene
from ico3d.splat.render import render

SIZE = 32


def offset_scene(only) -> TrainedScene:
    rng = np.random.default_rng(0)
    scene = scene_on_points(rng.normal(size=(60, 3)) * 0.1, rng.random((60, 3)), 1, 0.8, 1.0)
    return TrainedScene(scene, only, "all", "world", {"train_seconds": 7.0})


class OffsetScene(Capture):
    """What the scene renders; lighter by 0.1 where the person is, by 0.01 elsewhere."""

    kind, fps, num_frames, split = "offset", 25.0, 1, Split((), (0,))

    def __init__(self, path, trained, plate=None, cameras=9):
        self.path, self._trained, self._plate = path, trained, plate
        intrinsics = np.array([[50.0, 0, SIZE / 2], [0, 50.0, SIZE / 2], [0, 0, 1]])
        self.cameras = tuple(
            Camera(SIZE, SIZE, intrinsics, look_at([x, 0, 0.8], np.zeros(3)), f"c{n}")
            for n, x in enumerate(np.linspace(-0.3, 0.3, cameras))
        )

    def image(self, camera, frame):
        behind = None if self._plate is None else torch.full((3,), self._plate)
        with torch.no_grad():
            gaussians = self._trained.scene.gaussians()
            picture = render(gaussians, [self.cameras[camera]], behind).rgb[0]
        return np.clip(picture.numpy() * 0.8, 0, 0.8) + self._error()[..., None]

    def background(self, camera):
        if self._plate is None:
            return None
        return np.full((SIZE, SIZE, 3), self._plate, np.float32)

    def mask(self, camera, frame):
        mask = np.zeros((SIZE, SIZE), np.float32)
        mask[:, :8] = 1
        return mask

    def _error(self):
        return np.where(self.mask(0, 0) > 0, 0.1, 0.01).astype(np.float32)
