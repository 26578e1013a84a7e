"""Eight-bit basis vectors that share one scale per Gaussian."""

from dataclasses import dataclass

import numpy as np

_POWERS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Powers p of the vectors' sizes that are tried, see `quantise`."""
_LEAST = 1e-6
"""Least relative length that a basis vector is given."""


@dataclass(frozen=True)
class QuantisedBasis:
    """A basis (K, N, 4) in 8-bit numbers: basis_kn ≈ gains_k · scale_n · values_kn.

    Attributes:
        values: (K, N, 4) int8.
        scale: (N,) float32 scale of each Gaussian.
        gains: (K,) float32 factor of each basis vector, which the coefficient network takes over.
    """

    values: np.ndarray
    scale: np.ndarray
    gains: np.ndarray

    def restored(self) -> np.ndarray:
        """(K, N, 4) float32 basis that the 8-bit numbers stand for."""
        return self.gains[:, None, None] * self.scale[None, :, None] * self.values


def in_units(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vectors (M, N, 3) in 8-bit numbers, and the size (M,) of a unit of each."""
    units = np.maximum(np.abs(vectors).max(axis=(1, 2)) / 127, 1e-9)  # (M,)
    return np.rint(vectors / units[:, None, None]).astype(np.int8), units


def quantise(basis: np.ndarray, sizes: np.ndarray, weights: np.ndarray) -> QuantisedBasis:
    """Rounds a basis so that the error of basis · scores is small.

    All basis vectors of a Gaussian share one scale, so their relative lengths decide which of them
    keeps most precision. Each is multiplied by sizes^p before rounding, with the p of `_POWERS`
    that gives the least weighted error.

    Args:
        basis: (K, N, 4) float32.
        sizes: (K,) root mean square of each vector's scores.
        weights: (N, 4) how much an error in each logit matters.
    """
    candidates = [_round(basis, sizes.astype(np.float32) ** power) for power in _POWERS]
    return min(candidates, key=lambda candidate: _error(candidate, basis, sizes, weights))


def _round(basis: np.ndarray, lengths: np.ndarray) -> QuantisedBasis:
    lengths = np.maximum(lengths / max(lengths.max(), _LEAST), _LEAST)
    longer = basis * lengths[:, None, None]  # (K, N, 4)
    scale = np.abs(longer).max(axis=(0, 2)) / 127  # (N,)
    scale = np.maximum(scale, np.float32(1e-12))
    values = np.rint(longer / scale[None, :, None]).astype(np.int8)  # (K, N, 4)
    return QuantisedBasis(values, scale.astype(np.float32), (1 / lengths).astype(np.float32))


def _error(
    rounded: QuantisedBasis, basis: np.ndarray, sizes: np.ndarray, weights: np.ndarray
) -> float:
    error = (rounded.restored() - basis) * weights  # (K, N, 4)
    return float((np.square(error).sum(axis=(1, 2)) * sizes**2).sum())
