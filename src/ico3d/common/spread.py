"""Choosing a few evenly spread items of many."""

import numpy as np


def spread(count: int, most: int) -> list[int]:
    """Evenly spread indices into `count` items, at most `most`, the first and last among them.

    Args:
        count: Number of items.
        most: Highest number of indices; 1 gives the first alone.
    """
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)).tolist()
