"""Choosing a few of many."""

import numpy as np


def spread(count: int, most: int) -> list[int]:
    """Indices of at most so many of `count` things, evenly spread, the first and last among them.

    Args:
        count: How many there are.
        most: At least 2, or 1 for the first alone.
    """
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)).tolist()
