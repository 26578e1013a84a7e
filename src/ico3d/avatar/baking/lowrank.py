"""Principal components of a head's logits over expressions."""

from dataclasses import dataclass

import numpy as np

_CHUNK = 8192
"""Columns that are converted to float32 at a time; samples stay float16 in memory."""

_NOISE = 1e-6
"""Share of the largest variance below which a component is only float32 rounding."""


@dataclass(frozen=True)
class LowRank:
    """A low-rank approximation of samples (T, D): mean + scores @ basis.

    Attributes:
        mean: (D,) float32 mean of the samples.
        basis: (K, D) float32; its rows are orthonormal once its columns are multiplied by
            `weights`. Components are in falling order of variance.
        weights: (D,) how much an error in each column matters.
        scores: (T, K) float32 scores of the samples that the basis was made from.
    """

    mean: np.ndarray
    basis: np.ndarray
    weights: np.ndarray
    scores: np.ndarray

    def project(self, samples: np.ndarray) -> np.ndarray:
        """Scores (T, K) of samples (T, D) with the least error in the weighted norm."""
        scores = np.zeros((len(samples), len(self.basis)), np.float32)
        for part in _chunks(self.mean.size):
            centred = samples[:, part].astype(np.float32) - self.mean[part]  # (T, chunk)
            scores += centred @ (self.basis[:, part] * self.weights[part] ** 2).T  # (T, K)
        return scores


def factorise(samples: np.ndarray, weights: np.ndarray, rank: int) -> LowRank:
    """Weighted PCA from the (T, T) Gram matrix: memory beyond the samples is T² + K·D numbers.

    Args:
        samples: (T, D) float16 or float32, T ≥ 2.
        weights: (D,) positive weights of the columns.
        rank: K, number of components; those beyond what the samples span are zero.
    """
    mean = _mean(samples)
    gram = np.zeros((len(samples),) * 2)
    for part in _chunks(mean.size):
        centred = (samples[:, part].astype(np.float32) - mean[part]) * weights[part]  # (T, chunk)
        gram += centred @ centred.T  # (T, T)
    values, vectors = np.linalg.eigh(gram)
    order = np.argsort(values)[::-1][:rank]
    values, vectors = _padded(values[order], vectors[:, order], rank)
    spanned = values > max(_NOISE * values[0], 1e-12)
    sizes = np.sqrt(values, out=np.zeros(rank), where=spanned)  # (K,)
    mixing = vectors / np.where(spanned, sizes, np.inf)  # (T, K)
    basis = np.empty((rank, mean.size), np.float32)
    for part in _chunks(mean.size):
        centred = samples[:, part].astype(np.float32) - mean[part]  # (T, chunk)
        basis[:, part] = mixing.T @ (centred * weights[part]) / weights[part]  # (K, chunk)
    return LowRank(mean, basis, weights, (vectors * sizes).astype(np.float32))


def _padded(values: np.ndarray, vectors: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and eigenvectors filled up with zeros to `rank` where there are fewer."""
    lacking = rank - len(values)
    return np.pad(values, (0, lacking)), np.pad(vectors, ((0, 0), (0, lacking)))


def _mean(samples: np.ndarray) -> np.ndarray:
    mean = np.empty(samples.shape[1], np.float32)
    for part in _chunks(mean.size):
        mean[part] = samples[:, part].astype(np.float32).mean(axis=0)
    return mean


def _chunks(size: int) -> list[slice]:
    return [slice(start, start + _CHUNK) for start in range(0, size, _CHUNK)]
