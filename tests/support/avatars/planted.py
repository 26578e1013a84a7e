"""A planted capture: its pictures are those of a known head model, with some noise."""

from functools import cached_property
from pathlib import Path

import numpy as np
import torch

from ico3d.capture.capture import Capture, Sound, last_eleventh
from ico3d.common.camera import Camera, look_at
from ico3d.common.expression import EyeRange, eye_range
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from support.avatars.origins import origin
from support.heads.shapes import head_shape
from support.photograph import photograph

SIZE, FRAMES, COUNT = 48, 66, 300
NOISE = 0.03  # standard deviation: about 30 dB


class PlantedCapture(Capture):
    """One frontal and one lateral camera; the head sways and is still at frames 20 and 50."""

    kind = "planted"
    fps = 3.0
    num_frames = FRAMES

    def __init__(self, path: Path):
        self.path = path
        self.split = last_eleventh(FRAMES)
        intrinsics = np.array([[70.0, 0, SIZE / 2], [0, 70.0, SIZE / 2], [0, 0, 1]])
        self.cameras = tuple(
            Camera(SIZE, SIZE, intrinsics, look_at(np.array(eye), np.zeros(3)), str(number))
            for number, eye in enumerate(([0.5, 0.0, 0.3], [0.0, 0.05, 0.6]))
        )
        self.head: TrainedHead | None = None

    def blendshapes(self, frame):
        return self._smooth(frame, len(self.blendshape_names or ()))

    def eyes(self, frame):
        return self._smooth(frame, 7)

    def world_from_head(self, frame):
        angle = 0.1 * np.cos(np.pi * (frame - 20) / 30)
        pose = np.eye(4)
        pose[0, 0] = pose[2, 2] = np.cos(angle)
        pose[0, 2], pose[2, 0] = np.sin(angle), -np.sin(angle)
        return pose

    def background(self, camera):
        return np.full((SIZE, SIZE, 3), (0.3, 0.4, 0.5), np.float32)

    def landmarks(self, camera, frame):
        points = np.zeros((68, 3))
        points[0], points[16], points[30] = (-0.1, 0, 0), (0.1, 0, 0), (0, 0, 0.12)
        return self.cameras[camera].moved(self.world_from_head(frame)).project(points)[0]

    def audio(self):
        times = np.arange(int(16000 * FRAMES / self.fps)) / 16000
        wave = np.sin(2 * np.pi * (200 + 100 * np.sin(2 * times)) * times)
        return Sound((0.3 * wave * np.sin(3 * times) ** 2).astype(np.float32), 16000)

    @cached_property
    def _track(self):
        """What moved the face of the head that was recorded."""
        return self.head.track(self)

    def image(self, camera, frame):
        if frame % 2 != camera:
            return None
        with torch.no_grad():
            gaussians = self.head.model(self._track.at(frame)).detach()
        view = self.cameras[camera].moved(self.world_from_head(frame))
        behind = torch.from_numpy(self.background(camera))
        picture, _ = photograph(gaussians, view, behind)
        noise = np.random.default_rng(frame).normal(0, NOISE, picture.shape)
        return np.clip(picture + noise, 0, 1).astype(np.float32)

    @property
    def provenance(self):
        return origin("planted")

    @staticmethod
    def _smooth(frame, count):
        return (0.5 + 0.5 * np.sin(frame * 0.3 + np.arange(count))).astype(np.float32)


def planted_model(size: int) -> HeadModel:
    """Random features on an ellipsoid whose lower half moves; the last ten Gaussians are never
    seen."""
    generator = torch.Generator().manual_seed(0)
    model = HeadModel(head_shape(size, displacements=2), COUNT)
    directions = torch.randn(COUNT, 3, generator=generator)
    directions /= directions.norm(dim=1, keepdim=True)
    model.means.data = directions * torch.tensor([0.08, 0.11, 0.09])
    model.quats.data = torch.randn(COUNT, 4, generator=generator)
    model.log_scales.data.fill_(np.log(0.012))
    model.basis.data = torch.randn(model.basis.shape, generator=generator) * 0.3
    for layer in (model.trunk, model.color_branch, model.opacity_branch):
        layer.weight.data = torch.randn(layer.weight.shape, generator=generator) * 0.15
        layer.bias.data.zero_()
    model.opacity_branch.bias.data.fill_(2.0)
    model.log_scales.data[-10:].fill_(np.log(1e-5))
    low = (-directions[:, 1]).clamp_min(0)  # (N,)
    model.displacement_basis.data[0, :, 1] = -0.004 * low
    model.displacement_basis.data[1, :, 2] = 0.002 * low
    for layer in model.move_network:
        layer.copy_(torch.randn(layer.shape, generator=generator) * 0.2)
    return model


def planted_blendshape_head(folder: Path) -> tuple[TrainedHead, PlantedCapture]:
    """A head that is driven by blendshapes, and its capture."""
    capture = PlantedCapture(folder)
    names = capture.blendshape_names = tuple(f"shape{i}" for i in range(10))
    capture.head = TrainedHead(planted_model(10), "blendshapes", names, "", "", None, {})
    return capture.head, capture


def planted_eyes(capture: PlantedCapture) -> EyeRange:
    """How far eyes and brows move in what trains a head."""
    return eye_range(np.stack([capture.eyes(frame) for frame in capture.split.train]))


def driving(head: TrainedHead, recorded: np.ndarray) -> np.ndarray:
    """The expression that makes an avatar look as in a recording."""
    if head.adaptor is None:
        return recorded
    rest, most = np.array(head.eyes.rest), np.array(head.eyes.most)
    return np.concatenate([recorded[:32], (recorded[32:] - rest) / (most - rest)])
