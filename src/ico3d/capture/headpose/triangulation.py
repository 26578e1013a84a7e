"""Robust triangulation: 3D points from sightings by several calibrated cameras, some wrong.

Residuals are in metres: the distance at which a camera's ray passes a point. Landmark networks read
faces that are cut out and scaled to one size, so their errors are a share of the face's size, equal
for cameras near and far, of low and high resolution.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from ico3d.common.camera import Camera

SPREAD = 0.003
"""Usual error of a face's landmarks in metres."""
AGREEING = 0.012
"""Median residual in metres up to which a camera is taken to show the same face as others."""
LEAST_ANGLE = np.radians(4.0)
"""Least angle in radians between rays; at smaller angles the depth is undetermined."""
ROUNDS = 8


@dataclass(frozen=True)
class Sightings:
    """Where C cameras see the same N points at one moment.

    Attributes:
        world_to_camera: (C, 3, 4) poses in OpenCV axes, metres.
        rays: (C, N, 2) point at which each ray crosses the plane z = 1 of its camera.
    """

    world_to_camera: np.ndarray
    rays: np.ndarray

    def of(self, cameras: np.ndarray) -> "Sightings":
        """The sightings of some cameras, chosen by indices or by a mask (C,)."""
        return Sightings(self.world_to_camera[cameras], self.rays[cameras])

    @property
    def centers(self) -> np.ndarray:
        """(C, 3) positions of the cameras, metres."""
        turns, shifts = self.world_to_camera[:, :, :3], self.world_to_camera[:, :, 3:]
        return -(turns.transpose(0, 2, 1) @ shifts)[..., 0]  # (C, 3)

    @cached_property
    def system(self) -> tuple[np.ndarray, np.ndarray]:
        """(C, N, 2, 3) and (C, N, 2): matrix · point − right side are residuals in metres."""
        rows = self.world_to_camera[:, None]  # (C, 1, 3, 4)
        system = rows[:, :, :2] - self.rays[..., None] * rows[:, :, 2:]  # (C, N, 2, 4)
        return system[..., :3], -system[..., 3]

    @cached_property
    def normal(self) -> tuple[np.ndarray, np.ndarray]:
        """(C, N, 3, 3) and (C, N, 3): what each camera adds to the normal equations of a point."""
        matrix, right = self.system
        turned = matrix.swapaxes(-1, -2)  # (C, N, 3, 2)
        return turned @ matrix, (turned @ right[..., None])[..., 0]


def sightings(cameras: list[Camera], pixels: np.ndarray) -> Sightings:
    """Sightings from pixels (C, N, 2), with pixel centres at +0.5."""
    lenses = np.stack([camera.intrinsics for camera in cameras])  # (C, 3, 3)
    focal, center = lenses[:, [0, 1], [0, 1]], lenses[:, :2, 2]  # (C, 2)
    rays = (pixels - center[:, None]) / focal[:, None]  # (C, N, 2)
    return Sightings(np.stack([c.world_to_camera[:3] for c in cameras]), rays)


def triangulate(seen: Sightings, weights: np.ndarray) -> np.ndarray:
    """(N, 3) points with the least weighted sum of squared residuals, metres.

    Args:
        seen: Sightings by at least two cameras.
        weights: (C, N) weights; each point needs two cameras with a positive weight.
    """
    squares, pulls = seen.normal
    normal = (weights[..., None, None] * squares).sum(0)  # (N, 3, 3)
    pull = (weights[..., None] * pulls).sum(0)  # (N, 3)
    return np.linalg.solve(normal, pull[..., None])[..., 0]


def misses(seen: Sightings, points: np.ndarray) -> np.ndarray:
    """(C, N) residuals of points (N, 3), metres; infinite for points behind the camera."""
    matrix, right = seen.system
    # One axis after the other: sums along so short ones take several times as long.
    parts = (matrix[..., axis] * points[:, None, axis] for axis in range(3))
    off = sum(parts, start=-right)  # (C, N, 2)
    away = np.hypot(off[..., 0], off[..., 1])
    last = seen.world_to_camera[:, 2]
    depths = points @ last[:, :3].T + last[:, 3]  # (N, C)
    return np.where(depths.T > 0, away, np.inf)


def agreeing(seen: Sightings, tolerance: float = AGREEING) -> np.ndarray:
    """(C,) bool: the largest set of cameras that show one face.

    Each pair of cameras gives a position of the face. The pair wins with which most other cameras
    agree, then the one with the smallest residuals (RANSAC over all pairs, which are few). If no
    pair agrees, no camera is chosen.
    """
    best, best_score = np.zeros(len(seen.rays), bool), (1, 0.0)
    for pair in combinations(range(len(seen.rays)), 2):
        two = seen.of(np.array(pair))
        ones = np.ones(two.rays.shape[:2])
        if _meeting_angle(two) < LEAST_ANGLE:
            continue
        away = np.median(misses(seen, triangulate(two, ones)), axis=1)  # (C,)
        found = away < tolerance
        score = (int(found.sum()), -float(away[found].sum()))
        if found[list(pair)].all() and score > best_score:
            best, best_score = found, score
    return best


def robust(
    seen: Sightings, weights: np.ndarray, spread: float = SPREAD
) -> tuple[np.ndarray, np.ndarray]:
    """Robust triangulation: a camera with a large residual at a point is weighted down there.

    Args:
        seen: Sightings by cameras that agree.
        weights: (C, N) positive: how well each camera sees each point.
        spread: Usual error of the sightings, metres.

    Returns:
        (N, 3) points in metres, and the weights (C, N) of the last round (Cauchy's, times
        `weights`).
    """
    kept = weights
    for _ in range(ROUNDS):
        away = misses(seen, triangulate(seen, kept))
        kept = np.maximum(weights / (1 + (away / spread) ** 2), 1e-9)
    return triangulate(seen, kept), kept


def _meeting_angle(two: Sightings) -> float:
    """Radians between the middle rays of two cameras."""
    middles = np.append(two.rays.mean(1), np.ones((2, 1)), 1)  # (2, 3)
    ways = np.einsum("cji,cj->ci", two.world_to_camera[:, :, :3], middles)  # (2, 3) in the world
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return float(np.arccos(np.clip(ways[0] @ ways[1], -1, 1)))
