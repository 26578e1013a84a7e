"""Reads a person's lips out of speech features by ridge regression, before a head is trained.

Pictures alone teach a head slowly what speech means: one noisy gradient per picture, of which lips
are a few pixels. Where a recording tells how the lips move, a linear reading of that is found at
once, from all frames, and lasts.
"""

import numpy as np
import torch

from ico3d.common.spread import spread
from ico3d.speech.network import CONTEXT, SpeechAdaptor

SIZE = 0.3
"""Root mean square of the strongest lip value, as that of usual blendshapes."""
MOST_VALUES = 12
"""Most expression values that lips are given; the others are left to pictures alone."""
MOST_FRAMES = 3_000
"""Number of frames that are used, spread evenly over the recording."""

_DAMPINGS = (0.01, 0.03, 0.1, 0.3, 1.0)  # of features of deviation 1
_FOLDS = 5
_FAINT = 1e-2  # deviation, relative to the strongest, below which a value is left out


def read_lips(
    adaptor: SpeechAdaptor, features: np.ndarray, positions: np.ndarray, shapes: np.ndarray
) -> None:
    """Fits the linear reading of an adaptor, and silences its network in those values.

    The damping of the regression is the one that tells most about parts of the recording that are
    left out, five whole stretches of time.

    Args:
        adaptor: The adaptor of a head that is not trained yet; it is changed.
        features: (T, D) features of the recording's sound, 25 rows per second.
        positions: (F,) rows, as fractions, to which frames belong.
        shapes: (F, K) finite values of the lips' shape in those frames, in one unit.
    """
    chosen = np.array(spread(len(shapes), MOST_FRAMES))
    seen = _near(features, positions[chosen])  # (n, 5 · D)
    wanted = shapes[chosen] - shapes[chosen].mean(0)  # (n, K)
    if not len(wanted) or np.abs(wanted).max() < 1e-9:
        return
    mean, deviation = seen.mean(0), seen.std(0) + 1e-6
    unit = (seen - mean) / deviation
    weights = _ridge(unit, wanted, _best_damping(unit, wanted))  # (5 · D, K)
    weights, count = _principal(unit, weights)
    weights /= deviation[:, None]
    half = weights.T.astype(np.float16).astype(np.float32)  # (k, 5 · D), as bundles store it
    with torch.no_grad():
        adaptor.lips[:count] = torch.from_numpy(half)
        adaptor.lips_rest[:count] = torch.from_numpy(-half @ mean.astype(np.float32))
        last = [layer for layer in adaptor.adaptor if isinstance(layer, torch.nn.Linear)][-1]
        last.weight[:count] = 0
        last.bias[:count] = 0


def _near(features: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """(F, 5 · D) float64: the rows around positions (F,), interpolated; zeros around the sound."""
    padded = np.pad(features.astype(np.float64), ((CONTEXT, CONTEXT + 1), (0, 0)))
    at = np.clip(positions, 0, len(features) - 1)
    lower = at.astype(int)
    part = (at - lower)[:, None, None]
    rows = lower[:, None] + np.arange(2 * CONTEXT + 1)  # (F, 5)
    return ((1 - part) * padded[rows] + part * padded[rows + 1]).reshape(len(at), -1)


def _ridge(seen: np.ndarray, wanted: np.ndarray, damping: float) -> np.ndarray:
    """(M, K) weights from inputs (n, M) to values (n, K), by the smaller of two systems."""
    count, size = seen.shape
    if size <= count:
        return np.linalg.solve(seen.T @ seen + damping * count * np.eye(size), seen.T @ wanted)
    return seen.T @ np.linalg.solve(seen @ seen.T + damping * count * np.eye(count), wanted)


def _best_damping(seen: np.ndarray, wanted: np.ndarray) -> float:
    """The damping with the least squared error in stretches of time that were left out."""
    fold = np.arange(len(seen)) * _FOLDS // len(seen)
    errors = [
        sum(
            np.square(
                seen[fold == left] @ _ridge(seen[fold != left], wanted[fold != left], damping)
                - wanted[fold == left]
            ).sum()
            for left in range(_FOLDS)
        )
        for damping in _DAMPINGS
    ]
    return _DAMPINGS[int(np.argmin(errors))]


def _principal(seen: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, int]:
    """Weights (M, k) of the principal components of what weights (M, K) read, and k.

    The strongest component has the root mean square `SIZE`. The others are as much smaller as the
    roots of their deviations, so that small movements of the lips are learnt as well.
    """
    _, deviations, axes = np.linalg.svd(seen @ weights, full_matrices=False)
    count = int((deviations[:MOST_VALUES] > _FAINT * deviations[0]).sum())
    shares = np.sqrt(deviations[:count] / deviations[0])
    scales = SIZE * shares * np.sqrt(len(seen)) / deviations[:count]
    return weights @ axes[:count].T * scales, count
