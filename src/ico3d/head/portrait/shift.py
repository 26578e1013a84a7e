"""By how many pixels shoulders lie beside their place in another picture."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

LEVELS = (8, 4)
"""Numbers of pixels of which one is made, from coarse to fine."""
ROUNDS = 8
LEAST_PIXELS = 40
"""Fewest pixels, at the coarsest level, that tell anything."""
STIFFNESS = 0.02
"""How much contrast, relative to the mean, a direction must have to be believed."""
FARTHEST = 0.2
"""Largest shift, relative to the picture's width, that is believed."""


@dataclass(frozen=True)
class Seen:
    """Shoulders in a picture.

    Attributes:
        grey: (H, W) brightness, 0 to 1.
        mask: (H, W) 1 on shoulders and neck.
        neck: (H, W) 1 where the neck may be. What is there goes from side to side with the
            shoulders, but up and down as it likes: skin follows the chin.
    """

    grey: np.ndarray
    mask: np.ndarray
    neck: np.ndarray


def shift(first: Seen, now: Seen) -> np.ndarray:
    """How far shoulders have moved, by their brightness (Lucas and Kanade 1981).

    Args:
        first: Where they were.
        now: Where they are, in a picture of the same size.

    Returns:
        (2,) pixels to the right and down; 0 where too little of them is seen.
    """
    found = np.zeros(3)
    for level in LEVELS:
        before, after = (_coarser(seen, level) for seen in (first, now))
        if min(before.mask.sum(), after.mask.sum()) < LEAST_PIXELS:
            continue
        found = level * _refined(before, after, found / level)
    believed = np.abs(found).max() < FARTHEST * first.grey.shape[1]
    return found[:2] if believed else np.zeros(2)


def _coarser(seen: Seen, level: int) -> Seen:
    """One pixel of level × level."""
    height, width = (size // level * level for size in seen.grey.shape)

    def mean(picture: np.ndarray) -> np.ndarray:
        cut = picture[:height, :width].astype(np.float64)
        return cut.reshape(height // level, level, width // level, level).mean((1, 3))

    grey = ndimage.gaussian_filter(mean(seen.grey), 1.0)
    inside = ndimage.binary_erosion(mean(seen.mask) > 0.99, border_value=1)  # hair hangs over it
    return Seen(grey, inside, mean(seen.neck) > 0.5)


def _refined(first: Seen, now: Seen, start: np.ndarray) -> np.ndarray:
    """(3,) shift in pixels of this level, right, down, and down at the neck, from a coarser one."""
    found, neck = start, first.neck
    for _ in range(ROUNDS):
        back = np.where(neck, _moved(now.grey, found[[0, 2]]), _moved(now.grey, found[:2]))
        mask = now.mask.astype(np.float64)
        there = np.where(neck, _moved(mask, found[[0, 2]]), _moved(mask, found[:2])) > 0.99
        inside = first.mask & there
        if inside.sum() < LEAST_PIXELS:
            return start
        down, right = np.gradient(back)
        slopes = np.stack([right, down * ~neck, down * neck], -1)[inside]  # (P, 3)
        left_over = back[inside] - first.grey[inside]  # (P,)
        bound = 3 * np.median(np.abs(left_over)) + 1e-6
        weights = np.minimum(1, bound / np.maximum(np.abs(left_over), 1e-9))[:, None]  # (P, 1)
        normal = (weights * slopes).T @ slopes  # (3, 3)
        stiff = (STIFFNESS * np.trace(normal) + 1e-9) * np.eye(3)
        step = np.linalg.solve(normal + stiff, (weights * slopes).T @ left_over)  # (3,)
        found = found - step
        if np.abs(step).max() < 0.01:
            break
    return found


def _moved(picture: np.ndarray, by: np.ndarray) -> np.ndarray:
    """What lies `by` (2,) pixels to the right and down of each pixel."""
    return ndimage.shift(picture, -by[::-1], order=1, mode="nearest")
