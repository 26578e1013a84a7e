"""The 106 landmarks in pictures of a RenderMe-360 recording: as Multi-PIE's 68, and in space."""

import numpy as np

from ico3d.capture.headpose.triangulation import SPREAD, misses, robust, sightings
from ico3d.common.camera import Camera

POINTS = 106
MULTI_PIE = np.concatenate([np.arange(0, 33, 2), np.arange(33, 64), np.arange(84, 104)])
"""Where Multi-PIE's 68 are among SenseTime's 106: every other point of the jaw, and brows, nose,
eyes and lips without what lies between; both run from the person's right to the left."""
LEAST_VIEWS = 2
AGREEING = 3.0
"""Rays that pass by a point within so many of the usual deviations see it."""


def in_known_order(face: np.ndarray) -> bool:
    """Whether 68 landmarks (68, 2) in pixels can be Multi-PIE's.

    The files do not state the order of their 106 points: eyes, nose, mouth and chin must come one
    below the other, the eyes' corners from left to right, the nose between them.
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
    """Landmarks in the world from several pictures of one moment.

    Args:
        cameras: C of them.
        pixels: (C, 68, 2); NaN where not seen.

    Returns:
        (68, 3) metres; NaN where not two cameras agree.
    """
    seen = np.isfinite(pixels.sum(-1))  # (C, 68)
    if len(cameras) < LEAST_VIEWS or not seen.any():
        return np.full((pixels.shape[1], 3), np.nan)
    rays = sightings(cameras, np.where(seen[..., None], pixels, 0.0))
    points, _ = robust(rays, seen.astype(float))
    near = seen & (misses(rays, points) < AGREEING * SPREAD)  # (C, 68)
    return np.where((near.sum(0) >= LEAST_VIEWS)[:, None], points, np.nan)
