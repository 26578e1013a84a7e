"""The 106 landmarks of RenderMe-360: selection of Multi-PIE's 68, and triangulation."""

import numpy as np

from ico3d.capture.headpose.triangulation import SPREAD, misses, robust, sightings
from ico3d.common.camera import Camera

POINTS = 106
MULTI_PIE = np.concatenate([np.arange(0, 33, 2), np.arange(33, 64), np.arange(84, 104)])
"""Indices of Multi-PIE's 68 landmarks among SenseTime's 106.

The selection takes every other point of the jaw, and brows, nose, eyes and lips without the points
in between. Both sets run from the person's right to the left.
"""
LEAST_VIEWS = 2
AGREEING = 3.0
"""A ray agrees with a point up to this residual, in usual deviations."""


def in_known_order(face: np.ndarray) -> bool:
    """Whether landmarks (68, 2) in pixels can be in Multi-PIE's order.

    The files do not state the order of their 106 points. Eyes, nose, mouth and chin must lie one
    below the other, the corners of the eyes from left to right, with the nose between them.
    """
    across = face[45] - face[36]
    length = float(np.linalg.norm(across))
    if not length > 0:
        return False
    across = across / length
    down = np.array([-across[1], across[0]])
    corners = face[[36, 39, 27, 42, 45]] @ across
    levels = [float((face[part] @ down).mean()) for part in _PARTS_DOWNWARDS]
    return bool((np.diff(corners) > 0).all() and (np.diff(levels) > 0.1 * length).all())


_PARTS_DOWNWARDS = (slice(17, 27), slice(36, 48), slice(31, 36), slice(48, 68), slice(8, 9))
"""Brows, eyes, base of the nose, lips, chin."""


def in_space(cameras: list[Camera], pixels: np.ndarray) -> np.ndarray:
    """Triangulates landmarks from several pictures of one moment.

    Args:
        cameras: C cameras.
        pixels: (C, 68, 2) landmarks; NaN where not seen.

    Returns:
        (68, 3) in the world, metres; NaN where no two cameras agree.
    """
    seen = np.isfinite(pixels.sum(-1))  # (C, 68)
    if len(cameras) < LEAST_VIEWS or not seen.any():
        return np.full((pixels.shape[1], 3), np.nan)
    rays = sightings(cameras, np.where(seen[..., None], pixels, 0.0))
    points, _ = robust(rays, seen.astype(float))
    near = seen & (misses(rays, points) < AGREEING * SPREAD)  # (C, 68)
    return np.where((near.sum(0) >= LEAST_VIEWS)[:, None], points, np.nan)
