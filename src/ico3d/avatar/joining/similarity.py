"""The similarity between two canonical head spaces, from landmarks that both have."""

import numpy as np

from ico3d.errors import ModelError

STEADY = tuple(range(27, 68))
"""Multi-PIE landmarks that count: nose, eyes, and lips, whose mean is about the same wherever
somebody talks. Not jaw line and brows: sources differ by centimetres about where those run."""
KEPT = 0.8
"""Part of the landmarks that count in the end: the rest may be badly tracked."""
TRIPLES = 60
"""Of landmarks, from which fits begin: one without a bad landmark is among them."""
ROUNDS = 20


def similarity(target: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The similarity that takes points to others with the least squares (Umeyama, 1991).

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
    """G: from the head model's canonical space to that of the body's head poses.

    Least trimmed squares: the four fifths of the steady landmarks that agree best count.

    Args:
        body: (68, 3) landmarks in the space of the body's head poses, metres.
        head: (68, 3) the same landmarks in the space of the head's model.

    Returns:
        (4, 4) similarity, and the root mean square distance of the landmarks that count, metres.

    Raises:
        ModelError: If they are no face.
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
    """Fits to some points (P, 3), then again and again to those that agree best; None if flat."""
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
    """Points (…, 3) taken by a (4, 4) affine map."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def scale_of(matrix: np.ndarray) -> float:
    """The scale of a (4, 4) similarity."""
    return float(np.cbrt(np.linalg.det(matrix[:3, :3])))


def fit_in_words(matrix: np.ndarray, rest: float) -> str:
    """What `canonical_from_head` found, as the log says it."""
    size = scale_of(matrix)
    return f"head on body: landmarks agree within {1e3 * rest:.1f} mm, scale {size:.4f}."


def _distances(matrix: np.ndarray, target: np.ndarray, source: np.ndarray) -> np.ndarray:
    return np.linalg.norm(moved(matrix, source) - target, axis=1)  # (P,)
