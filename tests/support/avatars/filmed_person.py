"""A recording of the person that swings its arms: pictures with noise."""

import numpy as np
import torch

from ico3d.capture.capture import Capture, all_frames
from ico3d.common.camera import Camera, look_at
from support.avatars.moving_body import FPS, MovingPerson
from support.avatars.origins import origin
from support.photograph import photograph

SIZE, NOISE = 96, 0.03


class FilmedPerson(Capture):
    """Five cameras around the person; pictures with noise, masks, a plain background."""

    kind = "filmed"
    shows = "body"
    fps = FPS

    def __init__(self, person: MovingPerson, path):
        self.person, self.path = person, path
        self.num_frames = person.windows[-1].last + 1
        intrinsics = np.array([[130.0, 0, SIZE / 2], [0, 130.0, SIZE / 2], [0, 0, 1]])
        angles = 2 * np.pi * np.arange(5) / 5
        eyes = [(3 * np.sin(a), 1.0, 3 * np.cos(a)) for a in angles]
        self.cameras = tuple(
            Camera(SIZE, SIZE, intrinsics, look_at(eye, (0, 0.9, 0)), str(i))
            for i, eye in enumerate(eyes)
        )
        self.split = all_frames(self.num_frames, self.cameras)
        self._taken = {}

    def _drawn(self, camera, frame):
        if (camera, frame) not in self._taken:
            behind = torch.from_numpy(self.background(camera))
            gaussians = self.person.gaussians(frame / self.fps)
            self._taken[camera, frame] = photograph(gaussians, self.cameras[camera], behind)
        return self._taken[camera, frame]

    def image(self, camera, frame):
        picture, _ = self._drawn(camera, frame)
        noise = np.random.default_rng(frame).normal(0, NOISE, picture.shape)
        return (picture + noise).astype(np.float32)

    def mask(self, camera, frame):
        return (self._drawn(camera, frame)[1] > 0.5).astype(np.float32)

    def background(self, camera):
        return np.full((SIZE, SIZE, 3), (0.3, 0.4, 0.5), np.float32)

    @property
    def provenance(self):
        return origin("filmed")
