"""Groups of Gaussians that move alike, each with principal components of its own.

Clustered principal components (Sloan et al., "Clustered principal components for precomputed
radiance transfer", 2003), over time: the trajectories of a limb span few dimensions, those of a
whole person many.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_ROUNDS = 60
_ENOUGH = 1e-4
"""Share of the error that a round must take off for another one."""


@dataclass(frozen=True)
class Channel:
    """One property of all Gaussians over a window's time.

    Attributes:
        values: (S, N, D) float32.
        weights: (N,) what an error of size 1 does to the picture.
        rank: Components to keep.
    """

    values: np.ndarray
    weights: np.ndarray
    rank: int

    def centred(self) -> np.ndarray:
        """(S, N, D) about each Gaussian's mean over time, weighted."""
        offsets = self.values - self.values.mean(axis=0)
        return offsets * self.weights[:, None].astype(np.float32)


def group(channels: Sequence[Channel], count: int, seed: int = 0) -> np.ndarray:
    """Which cluster each Gaussian belongs to.

    Assigns Gaussians to the cluster whose components leave the least error in all channels, finds
    the components anew, and so on.

    Args:
        channels: The first one's motion gives the first clusters.
        count: Clusters at most.
        seed: Seed of the first clusters.

    Returns:
        (N,) uint8.
    """
    centred = [channel.centred() for channel in channels]
    labels = _first_labels(centred[0], count, np.random.default_rng(seed))
    error = np.inf
    for _ in range(_ROUNDS if count > 1 else 0):
        left = np.zeros((count, len(labels)))
        for motion, channel in zip(centred, channels, strict=True):
            left += _left_over(motion, _spans(motion, labels, count, channel.rank))
        labels, before = left.argmin(axis=0), error
        error = left.min(axis=0).sum()
        if before - error <= _ENOUGH * before:
            break
    return labels.astype(np.uint8)


def components(channel: Channel, labels: np.ndarray, count: int) -> np.ndarray:
    """(C, S, K) orthonormal courses over time that each cluster's Gaussians mix."""
    return _spans(channel.centred(), labels, count, channel.rank)


def _first_labels(motion: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """(N,) by the nearest of some Gaussians that move differently (k-means++)."""
    rows = np.ascontiguousarray(motion.transpose(1, 0, 2)).reshape(motion.shape[1], -1)
    nearest, labels = np.full(len(rows), np.inf), np.zeros(len(rows), int)
    chosen = int(rng.integers(len(rows)))
    for number in range(count):
        distance = np.square(rows - rows[chosen]).sum(axis=1)
        labels[distance < nearest] = number
        nearest = np.minimum(nearest, distance)
        total = nearest.sum(dtype=np.float64)
        if total <= 0:
            break  # no others move differently
        chosen = int(rng.choice(len(rows), p=nearest / total))
    return labels


def _spans(motion: np.ndarray, labels: np.ndarray, count: int, rank: int) -> np.ndarray:
    """(C, S, K): the main directions of each cluster's courses; zeros where there are fewer."""
    steps = len(motion)
    spans = np.zeros((count, steps, rank))
    for cluster in range(count):
        courses = motion[:, labels == cluster].reshape(steps, -1)  # (S, n·D)
        _, vectors = np.linalg.eigh((courses @ courses.T).astype(np.float64))
        main = vectors[:, ::-1][:, :rank]
        spans[cluster, :, : main.shape[1]] = main
    return spans


def _left_over(motion: np.ndarray, spans: np.ndarray) -> np.ndarray:
    """(C, N) squared error of each Gaussian in each cluster."""
    whole = np.square(motion).sum(axis=(0, 2))  # (N,)
    kept = [np.tensordot(span.T.astype(np.float32), motion, 1) for span in spans]  # C × (K, N, D)
    return np.stack([whole - np.square(part).sum(axis=(0, 2)) for part in kept])
