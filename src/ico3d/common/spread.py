"""A few evenly spread items of many, and directions all around."""

import numpy as np


def spread(count: int, most: int) -> list[int]:
    """Evenly spread indices into `count` items, at most `most`, the first and last among them.

    Args:
        count: Number of items.
        most: Highest number of indices; 1 gives the first alone.
    """
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)).tolist()


def directions(count: int) -> np.ndarray:
    """(count, 3) unit vectors, evenly spread (Fibonacci's spiral) about z, which is the first."""
    along = 1 - 2 * np.arange(count) / (count - 1)
    angle = np.arange(count) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - along**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), along], 1)
