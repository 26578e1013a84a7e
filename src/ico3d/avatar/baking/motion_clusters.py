"""Groups of Gaussians that move alike, each with principal components of its own.

These are clustered principal components (Sloan et al., "Clustered principal components for
precomputed radiance transfer", 2003) of trajectories over time: the trajectories of a limb span few
dimensions, those of a whole person many.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_ROUNDS = 60
"""Most rounds of assigning Gaussians and computing components."""
_ENOUGH = 1e-4
"""Relative decrease of the error by a round below which no further round follows."""


@dataclass(frozen=True)
class Channel:
    """One property of all Gaussians, such as their positions, over a window's time.

    Attributes:
        values: (S, N, D) float32, at S times.
        weights: (N,) how much an error of size 1 in each Gaussian matters.
        rank: Number K of components to keep.
    """

    values: np.ndarray
    weights: np.ndarray
    rank: int

    def centred(self) -> np.ndarray:
        """(S, N, D) deviations from each Gaussian's mean over time, times its weight."""
        offsets = self.values - self.values.mean(axis=0)
        return offsets * self.weights[:, None].astype(np.float32)


def group(channels: Sequence[Channel], count: int, seed: int = 0) -> np.ndarray:
    """Assigns each Gaussian to a cluster.

    In turn, components are computed for each cluster, and Gaussians are assigned to the cluster
    whose components leave the least error, summed over the channels.

    Args:
        channels: Properties; the initial clusters follow from the first one.
        count: Number of clusters at most, at most 256.
        seed: Seed of the initial clusters.

    Returns:
        (N,) uint8 index of each Gaussian's cluster.
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
    """(C, S, K) principal components over time of each of the C clusters, orthonormal in S."""
    return _spans(channel.centred(), labels, count, channel.rank)


def _first_labels(motion: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """(N,) initial clusters: each Gaussian goes to the nearest of `count` seeds (k-means++)."""
    rows = np.ascontiguousarray(motion.transpose(1, 0, 2)).reshape(motion.shape[1], -1)  # (N, S·D)
    nearest, labels = np.full(len(rows), np.inf), np.zeros(len(rows), int)
    chosen = int(rng.integers(len(rows)))
    for number in range(count):
        distance = np.square(rows - rows[chosen]).sum(axis=1)  # (N,)
        labels[distance < nearest] = number
        nearest = np.minimum(nearest, distance)
        total = nearest.sum(dtype=np.float64)
        if total <= 0:
            break  # every Gaussian moves exactly as one of the seeds
        chosen = int(rng.choice(len(rows), p=nearest / total))
    return labels


def _spans(motion: np.ndarray, labels: np.ndarray, count: int, rank: int) -> np.ndarray:
    """(C, S, K): each cluster's main directions over time; zeros where it has fewer than K."""
    steps = len(motion)
    spans = np.zeros((count, steps, rank))
    for cluster in range(count):
        courses = motion[:, labels == cluster].reshape(steps, -1)  # (S, n·D)
        _, vectors = np.linalg.eigh((courses @ courses.T).astype(np.float64))
        main = vectors[:, ::-1][:, :rank]  # (S, K), or fewer columns
        spans[cluster, :, : main.shape[1]] = main
    return spans


def _left_over(motion: np.ndarray, spans: np.ndarray) -> np.ndarray:
    """(C, N) squared error of each Gaussian if a cluster's components represent it."""
    whole = np.square(motion).sum(axis=(0, 2))  # (N,)
    kept = [np.tensordot(span.T.astype(np.float32), motion, 1) for span in spans]  # C × (K, N, D)
    return np.stack([whole - np.square(part).sum(axis=(0, 2)) for part in kept])  # (C, N)
