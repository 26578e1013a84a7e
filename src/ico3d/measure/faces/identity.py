"""Identity: how far the shape of a rendered face is from that of the recorded one, over time.

Distances of face embeddings are the usual measure; the public embeddings are bound to licences that
forbid commercial use. The shape of the skull's front, seen by MediaPipe's face model, needs none.
"""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.headpose.shape import moved, similarity_fit

LEFT_EYE, RIGHT_EYE = 263, 33
"""Landmarks of the outer corners of the eyes, whose distance is the unit."""
FEWEST_FRAMES = 8
"""Least number of frames for which a trend is told."""


@dataclass(frozen=True)
class Identity:
    """Distance of the shapes of two faces in percent of the distance of the outer eye corners.

    Attributes:
        distance: Mean over the frames.
        drift: Rise of the distance from the first to the last frame along the straight line that
            fits it best; None for fewer than `FEWEST_FRAMES` frames.
        frames: Number of frames that were compared.
    """

    distance: float
    drift: float | None
    frames: int


def identity_distances(points: np.ndarray, truth: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Distance of the shapes of two faces in each frame, whatever their pose, place and size.

    The points of the face are brought onto those of the true face by the similarity (Umeyama 1991)
    with the least weighted squares; the distance is the root of the weighted mean of the squares
    that are left. Landmarks without weight, which move with the expression, do not count.

    Args:
        points: (T, K, 3) landmarks in three dimensions, any unit; NaN where no face was seen.
        truth: (T, K, 3) landmarks of the true face in the same frames, or (K, 3) of its mean shape.
        weights: (K,) how rigidly each landmark sits on the skull (`CanonicalFace.rigidity`).

    Returns:
        (T,) percent of the distance of the outer eye corners of the true face; NaN where a face is
        missing.
    """
    wanted = np.broadcast_to(truth, points.shape)
    seen = np.isfinite(points).all((1, 2)) & np.isfinite(wanted).all((1, 2))
    found = np.full(len(points), np.nan)
    if seen.any():
        a, b = points[seen], wanted[seen]
        left = moved(similarity_fit(a, b, weights), a) - b  # (F, K, 3)
        squares = (left**2).sum(-1) @ weights / weights.sum()  # (F,)
        unit = np.linalg.norm(b[:, LEFT_EYE] - b[:, RIGHT_EYE], axis=1)  # (F,)
        found[seen] = 100 * np.sqrt(squares) / unit
    return found


def mean_face(points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The mean shape (K, 3) of faces (T, K, 3), each brought onto the first one that was seen.

    What is driven by somebody else's speech has no true frame of its own: this stands in for it.

    Raises:
        ValueError: If no face was seen.
    """
    seen = points[np.isfinite(points).all((1, 2))]
    if not len(seen):
        raise ValueError("no face was seen")
    onto = np.broadcast_to(seen[0], seen.shape)
    return moved(similarity_fit(seen, onto, weights), seen).mean(0)


def identity_of(distances: np.ndarray) -> Identity | None:
    """Mean and drift of distances (T,) at equal steps of time; None if all are NaN."""
    seen = np.flatnonzero(np.isfinite(distances))
    if not len(seen):
        return None
    values = distances[seen]
    drift = None
    if len(seen) >= FEWEST_FRAMES:
        drift = float(np.polyfit(seen, values, 1)[0] * (seen[-1] - seen[0]))
    return Identity(float(values.mean()), drift, len(seen))
