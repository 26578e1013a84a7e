"""A small head, and a capture whose pictures differ from it by a known error."""

import numpy as np
import torch

from ico3d.capture.capture import Capture, Split
from ico3d.common.camera import Camera, look_at
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.head.views import view_of
from ico3d.splat.render import render
from support.heads.shapes import head_shape

SIZE, ERROR = 32, 0.1


def offset_head(size=1.0) -> TrainedHead:
    torch.manual_seed(0)
    model = HeadModel(head_shape(2, "no-mlp"), 40)
    model.means.data = size * 0.1 * torch.randn(40, 3)
    model.log_scales.data.fill_(-3 + np.log(size))
    model.basis.data[:, :, :3] = torch.randn(3, 40, 3) - 1
    return TrainedHead(model, "blendshapes", ("a", "b"), "", "", None, {"train_seconds": 7.0})


class OffsetHead(Capture):
    """What the head renders, everywhere lighter by `ERROR`."""

    kind = "offset"
    fps = 25.0
    num_frames = 6
    split = Split((0, 1, 2), (3, 4, 5))
    blendshape_names = ("b", "extra", "a")

    def __init__(self, path, head: TrainedHead):
        self.path, self._head = path, head
        intrinsics = np.array([[50.0, 0, SIZE / 2], [0, 50.0, SIZE / 2], [0, 0, 1]])
        eyes = ([0.6, 0.0, 0.3], [0.05, 0.0, 0.7])
        self.cameras = tuple(
            Camera(SIZE, SIZE, intrinsics, look_at(np.array(eye), np.zeros(3)), name)
            for eye, name in zip(eyes, ("side", "front"), strict=True)
        )

    def blendshapes(self, frame):
        return np.array([0.1 * frame, 9.0, 1 - 0.1 * frame], np.float32)

    def world_from_head(self, frame):
        return np.eye(4)

    def image(self, camera, frame):
        if frame == 4 and camera == 0:
            return None
        weights = self.blendshapes(frame)
        expression = torch.tensor([weights[2], weights[0]])
        with torch.no_grad():
            gaussians = self._head.model(expression)
            picture = render(gaussians, [view_of(self, camera, frame).camera]).rgb[0]
        return (picture + ERROR).numpy()

    def background(self, camera):
        return np.zeros((SIZE, SIZE, 3), np.float32)

    def mask(self, camera, frame):
        return np.eye(SIZE, dtype=np.float32)

    def landmarks(self, camera, frame):
        return np.stack(np.meshgrid(np.arange(10, 22), np.arange(10, 16)), -1).reshape(-1, 2)[:68]
