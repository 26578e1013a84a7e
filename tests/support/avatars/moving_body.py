"""A person of Gaussians that swings its arms: what is baked in tests, known at every time."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch

from ico3d.splat.gaussians import Gaussians

FPS = 15.0
BONES = {  # name: (pivot, end, radius, axis, amplitude in radians, turns per second)
    "trunk": ((0.0, 0.9, 0.0), (0.0, 1.4, 0.0), 0.15, (0.0, 1.0, 0.0), 0.25, 0.4),
    "head": ((0.0, 1.6, 0.0), (0.0, 1.7, 0.0), 0.11, (1.0, 0.0, 0.0), 0.15, 0.9),
    "left arm": ((0.2, 1.4, 0.0), (0.25, 0.85, 0.0), 0.05, (1.0, 0.0, 0.0), 0.9, 0.8),
    "right arm": ((-0.2, 1.4, 0.0), (-0.25, 0.85, 0.0), 0.05, (0.0, 0.0, 1.0), -0.7, 0.6),
    "left leg": ((0.1, 0.9, 0.0), (0.12, 0.05, 0.0), 0.07, (1.0, 0.0, 0.0), 0.3, 0.8),
    "right leg": ((-0.1, 0.9, 0.0), (-0.12, 0.05, 0.0), 0.07, (1.0, 0.0, 0.0), -0.3, 0.8),
}


@dataclass(frozen=True)
class Span:
    first: int
    last: int


class MovingPerson:
    """Every window holds the same Gaussians in an order of its own, so that neighbours agree."""

    fps = FPS
    summary: dict = {}  # noqa: RUF012

    def __init__(self, count: int = 600, borders: tuple[int, ...] = (0, 7, 16, 22), seed: int = 0):
        rng = np.random.default_rng(seed)
        self.windows = [Span(a, b) for a, b in pairwise(borders)]
        sizes = np.array([np.hypot(*np.subtract(b[0], b[1])[:2]) * b[2] for b in BONES.values()])
        self.bone = rng.choice(len(BONES), count, p=sizes / sizes.sum())
        self.rest = _around_bones(self.bone, rng)  # (N, 3)
        self.quats = rng.normal(size=(count, 4))
        size = 1.2 / np.sqrt(count)
        self.scales = rng.uniform(0.3, 1.0, (count, 3)) * size * 0.35
        self.colors = rng.uniform(0.2, 0.9, (len(BONES), 3))[self.bone]
        self.colors += rng.normal(0, 0.05, (count, 3))
        self.opacities = rng.uniform(0.5, 1.0, count)
        self.orders = [rng.permutation(count) for _ in self.windows]

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        span = self.windows[index]
        frame = span.first + tau * (span.last - span.first)
        return self.gaussians(frame / self.fps)[torch.from_numpy(self.orders[index])]

    def gaussians(self, seconds: float) -> Gaussians:
        means, quats = np.empty_like(self.rest), np.empty_like(self.quats)
        for number, bone in enumerate(BONES.values()):
            chosen = self.bone == number
            pivot, _, _, axis, amplitude, rate = bone
            angle = amplitude * np.sin(2 * np.pi * rate * seconds)
            turn = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.array(axis))])
            offset = self.rest[chosen] - pivot
            means[chosen] = pivot + _rotate(turn, offset)
            quats[chosen] = _multiply(turn, self.quats[chosen])
        breath = 1 + 0.1 * np.sin(2 * np.pi * 0.5 * seconds) * (self.bone == 0)
        return Gaussians(
            means=torch.tensor(means, dtype=torch.float32),
            quats=torch.tensor(quats, dtype=torch.float32),
            scales=torch.tensor(self.scales * breath[:, None], dtype=torch.float32),
            opacities=torch.tensor(self.opacities, dtype=torch.float32),
            colors=torch.tensor(self.colors.clip(0, 1), dtype=torch.float32),
        )


def _around_bones(bone: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Points on capsules around the bones (N, 3)."""
    points = np.empty((len(bone), 3))
    for number, (start, end, radius, *_) in enumerate(BONES.values()):
        chosen = bone == number
        along = rng.uniform(0, 1, (chosen.sum(), 1))
        around = rng.normal(size=(chosen.sum(), 3))
        around *= radius / np.linalg.norm(around, axis=1, keepdims=True)
        points[chosen] = np.array(start) + along * np.subtract(end, start) + around
    return points


def _multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of (4,) and (N, 4)."""
    w, x, y, z = a
    matrix = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return b @ matrix.T


def _rotate(turn: np.ndarray, points: np.ndarray) -> np.ndarray:
    pure = np.pad(points, ((0, 0), (1, 0)))  # (N, 4)
    inverse = turn * (1, -1, -1, -1)
    right = np.stack([_multiply(q, inverse[None])[0] for q in _multiply(turn, pure)])
    return right[:, 1:]
