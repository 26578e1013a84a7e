"""Random places on triangles."""

import numpy as np


def areas(triangles: np.ndarray) -> np.ndarray:
    """(F,) twice the areas of triangles (F, 3, 3), which are corners."""
    a, b, c = triangles.swapaxes(0, 1)  # (F, 3) each
    return np.linalg.norm(np.cross(b - a, c - a), axis=1)


def scattered(
    weights: np.ndarray, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Places on triangles, evenly on each.

    Args:
        weights: (F,) how many places each triangle gets, relative to the others.
        count: N, number of places.
        random: Source of the places.

    Returns:
        (N,) the triangle of each place, and (N, 3) its weights of the triangle's corners.
    """
    chosen = random.choice(len(weights), size=count, p=weights / weights.sum())
    u, v = random.random((2, count))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return chosen, np.stack([1 - u - v, u, v], 1)
