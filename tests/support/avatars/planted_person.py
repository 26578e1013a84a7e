"""A person made of Gaussians: a head as HeadGaS++ models them, on a body, recorded in any studio.

Everything is known: where each Gaussian of the head is in every frame, and which colour it has.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from ico3d.capture.capture import Capture, all_frames
from ico3d.common.camera import Camera, look_at
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians, cat
from support.heads.shapes import head_shape
from support.photograph import photograph

WIDTH, HEIGHT, CAMERAS, FRAMES = 40, 52, 10, 6
NAMES = tuple(f"shape{i}" for i in range(10))
AXES = np.array([0.075, 0.11, 0.09])
"""Half axes of the head in metres: x to its left, y up, z where it looks."""
WARM = (1.0, 0.85, 0.65)
ABROAD = np.eye(4)
"""Canonical space of the other studio's head poses from that of the head's model."""
ABROAD[:3, :3] = 1.1 * Rotation.from_euler("xyz", (20, -35, 10), degrees=True).as_matrix()
ABROAD[:3, 3] = 0.02, -0.03, 0.05


def on_head(across, up):
    """(P, 3) places on the front of the head, at parts of its half axes."""
    across, up = np.broadcast_arrays(np.asarray(across, float), np.asarray(up, float))
    front = np.sqrt((1 - across**2 - up**2).clip(0.0))
    return AXES * np.stack([across, up, front], -1)


def face() -> np.ndarray:
    """(68, 3) Multi-PIE landmarks."""
    turn = np.linspace(-1, 1, 17) * np.pi / 2
    height = 0.1 - 0.75 * np.cos(turn).clip(0) ** 0.5
    jaw = AXES * np.stack([0.97 * np.sin(turn), height, 0.75 * np.cos(turn) ** 2], 1)
    brows = [on_head(np.linspace(*ends, 5), 0.42) for ends in ((-0.6, -0.15), (0.15, 0.6))]
    bridge = on_head(0, np.linspace(0.3, -0.05, 4)) + np.array([0, 0, 0.01])
    nostrils = on_head(np.linspace(-0.2, 0.2, 5), -0.12)
    circle = np.arange(6) * np.pi / 3
    eyes = [on_head(x - 0.12 * np.cos(circle), 0.28 + 0.05 * np.sin(circle)) for x in (-0.4, 0.4)]
    circle = np.arange(20) * np.pi / 10
    mouth = on_head(0.3 * np.cos(circle), -0.4 + 0.08 * np.sin(circle))
    return np.concatenate([jaw, *brows, bridge, nostrils, *eyes, mouth])


def planted_model(count: int = 500) -> HeadModel:
    """Colours that change softly over an ellipsoid, and a little with the expression."""
    generator = torch.Generator().manual_seed(0)
    model = HeadModel(head_shape(len(NAMES), frequencies=1, box_size=0.12), count)
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    model.means.data = torch.from_numpy(AXES * directions).float()
    model.quats.data = torch.randn(count, 4, generator=generator)
    model.log_scales.data = torch.full((count, 3), np.log(0.009))
    model.log_scales.data += 0.2 * torch.randn(count, 3, generator=generator)
    model.basis.data = 0.05 * torch.randn(model.basis.shape, generator=generator)
    for layer in (model.trunk, model.color_branch, model.opacity_branch):
        layer.weight.data = 0.3 * torch.randn(layer.weight.shape, generator=generator)
        layer.bias.data.zero_()
    model.opacity_branch.weight.data *= 0.1
    model.opacity_branch.bias.data.fill_(3.0)
    return model.requires_grad_(False)


def planted_head() -> TrainedHead:
    """With its landmarks, driven by blendshapes."""
    return TrainedHead(planted_model(), "blendshapes", NAMES, "", "", None, {}, face())


def body(rng: np.random.Generator) -> Gaussians:
    """Trunk and neck, in the world of the first studio, in which a head's middle is at 0."""
    ball = rng.normal(size=(700, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    trunk = ball[:500] * (0.2, 0.25, 0.12) + (0, -0.42, -0.02)
    neck = ball[500:] * (0.05, 0.13, 0.05) + (0, -0.15, -0.02)
    points = np.concatenate([trunk, neck])
    return Gaussians(
        torch.from_numpy(points).float(),
        torch.tensor([1.0, 0, 0, 0]).repeat(700, 1),
        torch.full((700, 3), 0.016),
        torch.full((700,), 0.9),
        torch.from_numpy(0.5 + 0.3 * np.sin(30 * points)).float(),
    )


class PlantedPerson(Capture):
    """Cameras on a ring; the head nods and turns, the body does not move.

    Args:
        path: Its name.
        canonical_from_head: (4, 4) a similarity from the head model's space to that of the
            recording's head poses; its scale is that of the recording's metre.
        world_from_first: (4, 4) rigid; from the first studio's world.
        gain: What the light does to red, green and blue.
    """

    kind = "planted person"
    shows = "body"
    fps = 15.0
    num_frames = FRAMES
    blendshape_names = NAMES

    def __init__(self, path, canonical_from_head=None, world_from_first=None, gain=(1, 1, 1)):
        self.path = Path(path)
        self.head = planted_head()
        self.canonical_from_head = np.eye(4) if canonical_from_head is None else canonical_from_head
        self.scale = float(np.cbrt(np.linalg.det(self.canonical_from_head[:3, :3])))
        self._from_first = np.eye(4) if world_from_first is None else world_from_first
        self._gain = torch.tensor(gain, dtype=torch.float32)
        intrinsics = np.array([[57.0, 0, WIDTH / 2], [0, 57.0, 16.0], [0, 0, 1]])
        turns = np.arange(CAMERAS) * 2 * np.pi / CAMERAS
        self.cameras = tuple(
            self._camera(intrinsics, (0.9 * np.sin(a), 0.1, 0.9 * np.cos(a)), f"c{number}")
            for number, a in enumerate(turns)
        )
        self.split = all_frames(FRAMES, self.cameras)
        self._body = body(np.random.default_rng(1)).transform(self._from_first @ self._grown)
        self._taken = {}

    @classmethod
    def elsewhere(cls, path):
        """In a warm studio whose metre, world and head poses are others."""
        world = np.eye(4)
        world[:3, :3] = Rotation.from_euler("y", 50, degrees=True).as_matrix()
        world[:3, 3] = 0.3, 1.5, -0.2
        return cls(path, ABROAD, world, WARM)

    @property
    def _grown(self):
        return np.diag([self.scale] * 3 + [1.0])

    def _camera(self, intrinsics, eye, name):
        pose = look_at(self.scale * np.array(eye), self.scale * np.array([0, -0.1, 0]))
        return Camera(WIDTH, HEIGHT, intrinsics, pose @ np.linalg.inv(self._from_first), name)

    def true_world_from_head(self, frame) -> np.ndarray:
        """(4, 4) where the head model's space is, as nobody but the test knows."""
        nod = np.eye(4)
        angles = 6 * np.sin(frame), 9 * np.cos(frame), 0
        nod[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
        return self._from_first @ self._grown @ nod

    def world_from_head(self, frame):
        return self.true_world_from_head(frame) @ np.linalg.inv(self.canonical_from_head)

    def landmarks(self, camera, frame):
        noise = np.random.default_rng([camera, frame]).normal(0, 0.1, (68, 2))
        points = face() @ self.true_world_from_head(frame)[:3, :3].T
        return (
            self.cameras[camera].project(points + self.true_world_from_head(frame)[:3, 3])[0]
            + noise
        )

    def blendshapes(self, frame):
        return (0.5 + 0.5 * np.sin(frame * 0.7 + np.arange(10))).astype(np.float32)

    def world_points(self, frame=0):
        return self.person(frame).means.numpy()

    def person(self, frame) -> Gaussians:
        """Everything that is recorded."""
        drawn = self.head.model(torch.from_numpy(self.blendshapes(frame)))
        head = drawn.transform(self.true_world_from_head(frame))
        whole = cat([self._body, head])
        return replace(whole, colors=whole.colors * self._gain)

    def background(self, camera):
        return np.full((HEIGHT, WIDTH, 3), 0.4, np.float32)

    def _picture(self, camera, frame):
        if (camera, frame) not in self._taken:
            plate = torch.from_numpy(self.background(camera))
            self._taken[camera, frame] = photograph(self.person(frame), self.cameras[camera], plate)
        return self._taken[camera, frame]

    def image(self, camera, frame):
        return self._picture(camera, frame)[0].clip(0, 1)

    def mask(self, camera, frame):
        return self._picture(camera, frame)[1]
