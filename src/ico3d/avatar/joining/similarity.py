"""The similarity between two canonical head spaces, from landmarks that both have."""

import numpy as np

from ico3d.errors import ModelError

STEADY = tuple(range(27, 68))
"""Indices of the Multi-PIE landmarks that count: nose, eyes, and lips.

The mean of talking lips is about the same in all recordings. Jaw line and brows do not count, as
sources differ by centimetres about where they are.
"""
KEPT = 0.8
"""Share of the landmarks that count in the end; the rest may be badly tracked."""
TRIPLES = 60
"""Number of random triples of landmarks from which fits begin, so that one has no bad landmark."""
ROUNDS = 20
"""Most rounds of fitting and choosing the landmarks that agree best."""


def similarity(target: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The similarity from source to target points with the least squared error (Umeyama, 1991).

    Args:
        target: (P, 3), P ≥ 3, not on one line.
        source: (P, 3).

    Returns:
        (4, 4) `target_from_source`: rotation, uniform scale, translation; never mirrors.

    Raises:
        ValueError: If the points lie on one line.
    """
    middles = target.mean(0), source.mean(0)  # (3,), (3,)
    a, b = target - middles[0], source - middles[1]  # (P, 3)
    left, sizes, right = np.linalg.svd(a.T @ b)
    if sizes[1] < 1e-9 * max(sizes[0], 1e-12):
        raise ValueError("points on one line do not tell a rotation")
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ np.diag(signs) @ right
    scale = (sizes * signs).sum() / np.square(b).sum()
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation
    matrix[:3, 3] = middles[0] - scale * rotation @ middles[1]
    return matrix


def canonical_from_head(body: np.ndarray, head: np.ndarray) -> tuple[np.ndarray, float]:
    """G, the similarity from the head model's space to canonical head space of the body's capture.

    It is fitted by least trimmed squares: the four fifths of the landmarks in `STEADY` that agree
    best count.

    Args:
        body: (68, 3) landmarks in canonical head space of the body's capture, metres.
        head: (68, 3) the same landmarks in the space of the head's model.

    Returns:
        (4, 4) similarity, and the root mean square distance of the landmarks that count, metres.

    Raises:
        ModelError: If the landmarks lie on one line.
    """
    target, source = body[list(STEADY)], head[list(STEADY)]  # (P, 3)
    rng = np.random.default_rng(0)
    begins = [np.arange(len(target))]
    begins += [rng.choice(len(target), 3, replace=False) for _ in range(TRIPLES)]
    fits = [fit for begin in begins if (fit := _trimmed(target, source, begin)) is not None]
    if not fits:
        raise ModelError("the landmarks lie on one line: track head and body again.")
    return min(fits, key=lambda fit: fit[1])


def _trimmed(
    target: np.ndarray, source: np.ndarray, chosen: np.ndarray
) -> tuple[np.ndarray, float] | None:
    """Least trimmed squares of points (P, 3), beginning with a fit to the chosen indices.

    Returns:
        (4, 4) similarity, and the root mean square distance of the points that count; None where
        the points of a fit lie on one line.
    """
    for _ in range(ROUNDS):
        before = chosen
        try:
            matrix = similarity(target[chosen], source[chosen])
        except ValueError:
            return None
        away = _distances(matrix, target, source)  # (P,)
        chosen = np.sort(np.argsort(away, kind="stable")[: round(KEPT * len(target))])
        if np.array_equal(chosen, before):
            break
    return matrix, float(np.sqrt(np.square(away[chosen]).mean()))


def moved(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (…, 3) transformed by a (4, 4) affine matrix."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def scale_of(matrix: np.ndarray) -> float:
    """The scale of a (4, 4) similarity."""
    return float(np.cbrt(np.linalg.det(matrix[:3, :3])))


def fit_in_words(matrix: np.ndarray, rest: float) -> str:
    """The results of `canonical_from_head` as a sentence for people."""
    size = scale_of(matrix)
    return f"head on body: landmarks agree within {1e3 * rest:.1f} mm, scale {size:.4f}."


def _distances(matrix: np.ndarray, target: np.ndarray, source: np.ndarray) -> np.ndarray:
    return np.linalg.norm(moved(matrix, source) - target, axis=1)  # (P,)
