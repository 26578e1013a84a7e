"""A tiny head with landmarks and shoulders, seen by one camera in every frame."""

from pathlib import Path

import numpy as np

from ico3d.common.camera import Camera, look_at
from support.heads.tiny_capture import TinyCapture

HEIGHT = 72
"""Rows and columns of the pictures."""


def face_points() -> np.ndarray:
    """(68, 3) Multi-PIE landmarks before the tiny head, metres."""
    jaw = np.linspace(0, np.pi, 17)
    rows = [np.stack([-0.12 * np.cos(jaw), -0.13 * np.sin(jaw)], 1)]
    for left, right, height, count in (
        *((-0.1, -0.02, 0.07, 5), (0.02, 0.1, 0.07, 5), (0, 0, 0.04, 4), (-0.03, 0.03, -0.02, 5)),
        *((-0.08, -0.03, 0.04, 6), (0.03, 0.08, 0.04, 6), (-0.05, 0.05, -0.06, 12)),
        (-0.03, 0.03, -0.06, 8),
    ):
        rows.append(np.stack([np.linspace(left, right, count), np.full(count, height)], 1))
    flat = np.concatenate(rows)  # (68, 2)
    return np.concatenate([flat, np.full((68, 1), 0.15)], 1)


class TinyTalker(TinyCapture):
    """A shell of Gaussians before a grey plate; the lower part of the picture shows shoulders."""

    fps = 25.0

    def __init__(self, path: Path):
        super().__init__(path, HEIGHT)
        lens = np.array([[90.0, 0, HEIGHT / 2], [0, 90.0, HEIGHT / 2], [0, 0, 1]])
        eye = look_at(np.array([0.0, 0.0, 1.0]), np.zeros(3))
        self.cameras = (Camera(HEIGHT, HEIGHT, lens, eye, "0"),)

    def image(self, camera, frame):
        picture = self._render(camera, frame, self.background(camera))[0]
        picture[-8:] = (0.1, 0.6, 0.2)
        return picture

    def mask(self, camera, frame):
        person = self._render(camera, frame, None)[1]
        person[-8:] = 1.0
        return person

    def landmarks_3d(self, frame):
        return face_points()

    def landmarks(self, camera, frame):
        seen = self.cameras[camera].moved(self.world_from_head(frame))
        return seen.project(face_points())[0]
