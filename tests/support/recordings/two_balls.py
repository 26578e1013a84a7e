"""A person made of two balls, head and trunk, before a curtain; the pictures cut the trunk off."""

from pathlib import Path

import numpy as np

from ico3d.capture.capture import Capture, Sound, last_eleventh
from ico3d.common.camera import Camera, look_at

HEAD, TRUNK = 0.1, 0.17
"""Radii, metres."""
CENTERS = np.array([[0.0, 0.0, 0.0], [0.0, -0.25, 0.0]])
RADII = np.array([HEAD, TRUNK])
DISTANCE = 1.35
NODDING, SHIFTING = 0.12, 0.01
"""Radians that the head turns and metres that it moves, while the trunk stays."""


def arc(size, count=6, widest=60.0):
    """Cameras on a frontal arc that aim between head and trunk."""
    focal = size * DISTANCE / 0.44
    intrinsics = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]])
    turns = np.radians(np.linspace(-widest, widest, count))
    target = np.array([0, -0.11, 0])
    return tuple(
        Camera(size, size, intrinsics, look_at(eye, target), str(number))
        for number, eye in enumerate(
            target + DISTANCE * np.array([np.sin(a), 0.12 * (-1) ** n, np.cos(a)])
            for n, a in enumerate(turns)
        )
    )


def ball_points(ball, count, seed=0):
    """(count, 3) points on head (0) or trunk (1)."""
    way = np.random.default_rng(seed).normal(size=(count, 3))
    return CENTERS[ball] + RADII[ball] * way / np.linalg.norm(way, axis=1, keepdims=True)


def outside(points):
    """(P,) metres that points lie outside of the nearer ball; less than 0 within."""
    away = np.linalg.norm(points[:, None] - CENTERS, axis=2) - RADII  # (P, 2)
    return away.min(1)


def seen_by(camera, world_from_head=None):
    """Which ball each pixel of a camera shows, -1 for none, and where on it: (H, W), (H, W, 3)."""
    pose = np.eye(4) if world_from_head is None else world_from_head
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    rays = np.stack([columns, rows, np.ones_like(rows)], -1) @ np.linalg.inv(camera.intrinsics).T
    rays = rays @ camera.camera_to_world[:3, :3].T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    eye, best = camera.camera_to_world[:3, 3], np.full(rays.shape[:2], np.inf)
    shown, places = np.full(rays.shape[:2], -1), np.zeros(rays.shape)
    centers = (pose[:3, 3], CENTERS[1])
    for ball, (center, radius) in enumerate(zip(centers, RADII, strict=True)):
        along = rays @ (center - eye)
        root = along**2 - np.square(center - eye).sum() + radius**2
        hit = (root > 0) & (along - np.sqrt(np.maximum(root, 0)) < best)
        depth = along - np.sqrt(np.maximum(root, 0))
        best[hit], shown[hit] = depth[hit], ball
        places[hit] = (eye + rays * depth[..., None])[hit] - center
    turned = shown == 0
    places[turned] = places[turned] @ pose[:3, :3]
    return shown, places


class TwoBalls(Capture):
    """Recorded as RenderMe-360 is: points on the head alone, masks of all, no plate, no eyes.

    The head reddens with the first of its blendshapes.
    """

    kind = "two-balls"
    fps, num_frames = 30.0, 33
    blendshape_names = ("redden",)

    def __init__(self, path: Path, size=40):
        self.path, self.cameras = path, arc(size)
        self.split = last_eleventh(self.num_frames)

    def head_points(self, frame=0):
        return ball_points(0, 600)

    def blendshapes(self, frame):
        return np.array([np.sin(0.4 * frame) ** 2], np.float32)

    def world_from_head(self, frame):
        angle, pose = NODDING * np.sin(0.5 * frame), np.eye(4)
        pose[:3, :3] = [
            [np.cos(angle), 0, np.sin(angle)],
            [0, 1, 0],
            [-np.sin(angle), 0, np.cos(angle)],
        ]
        pose[0, 3] = SHIFTING * np.sin(0.7 * frame)
        return pose

    def audio(self):
        return Sound(np.zeros(int(16000 * self.num_frames / self.fps), np.float32), 16000)

    def mask(self, camera, frame):
        shown, _ = seen_by(self.cameras[camera], self.world_from_head(frame))
        return (shown >= 0).astype(np.float32)

    def image(self, camera, frame):
        shown, places = seen_by(self.cameras[camera], self.world_from_head(frame))
        way = places / HEAD
        skin = 0.55 + 0.2 * np.sin(4 * way + [0, 1, 2])
        skin[..., 0] += 0.2 * self.blendshapes(frame)
        cloth = 0.3 + 0.15 * np.sin(3 * way + [2, 0, 1])
        curtain = np.full((*shown.shape, 3), [0.75, 0.2, 0.2])
        curtain[:, ::3] = [0.5, 0.1, 0.15]
        picture = np.where((shown == 0)[..., None], skin, cloth)
        return np.where((shown < 0)[..., None], curtain, picture).clip(0, 1).astype(np.float32)
