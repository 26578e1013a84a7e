"""Initial Gaussians from surface points: their number and their spacing."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportMissingTypeStubs=false
# (scipy is untyped)

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from ico3d.common.camera import Camera


def resampled(points: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """`count` points drawn from (P, 3); if P is smaller, further ones between neighbours."""
    if len(points) >= count:
        return points[np.sort(rng.choice(len(points), count, replace=False))]
    _, neighbours = KDTree(points).query(points, k=4)  # (P, 4), itself first
    source = rng.integers(len(points), size=count - len(points))  # (extra,)
    partner = np.asarray(neighbours)[source, rng.integers(1, 4, size=len(source))]  # (extra,)
    weight = rng.random((len(source), 1))
    between = points[source] * weight + points[partner] * (1 - weight)
    return np.concatenate([points, between])


def spacing(points: np.ndarray) -> np.ndarray:
    """Root mean square distance (N,) to the three nearest neighbours.

    Values are limited to a tenth of the median and ten times the median.
    """
    distances, _ = KDTree(points).query(points, k=4)
    distance = np.sqrt((distances[:, 1:] ** 2).mean(1))
    typical = float(np.median(distance))
    return np.clip(distance, max(typical / 10, math.ulp(1.0)), typical * 10)


def in_pictures(points: np.ndarray, cameras: Sequence[Camera]) -> np.ndarray:
    """(C, P) bool: whether each point (P, 3) lies within each camera's picture."""
    inside = np.zeros((len(cameras), len(points)), bool)
    for row, camera in zip(inside, cameras, strict=True):
        pixels, depths = camera.project(points)  # (P, 2), (P,)
        fits = (pixels >= 0) & (pixels < (camera.width, camera.height))
        row[:] = fits.all(1) & (depths > 0)
    return inside
