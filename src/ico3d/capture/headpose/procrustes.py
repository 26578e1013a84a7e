"""Generalised Procrustes analysis: rigid motion of points, some of them missing or wrong."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.headpose.shape import inverse, moved, rigid_fit

FEWEST_POINTS = 6
"""Least number of points that a frame must have; fewer may lie on a line."""
ROUNDS = 40
SPREAD_FLOOR = 1e-9
"""Least standard deviation of a point in metres, which keeps weights finite without noise."""
STEADY_QUARTER, STEADIEST = 0.25, 0.5
"""A quantile of the points' deviations, and a factor of that quantile: no deviation is less.

Otherwise a single very steady point would determine everything.
"""
MEDIAN_LENGTH = 1.538
"""Median length of a 3D vector with standard normal components."""


@dataclass(frozen=True)
class RigidMotion:
    """Rigid motion of K points through F frames, as Procrustes analysis finds it.

    Attributes:
        shape: (K, 3) positions on the body, metres; NaN for points never seen.
        poses: (F, 4, 4) from the body's space to each frame; NaN for frames with too few points.
        spreads: (K,) standard deviation of each point along an axis, metres; infinite if never
            seen.
        weights: (F, K) inverse variances used for the poses; 0 for unseen points.
    """

    shape: np.ndarray
    poses: np.ndarray
    spreads: np.ndarray
    weights: np.ndarray

    def in_frame(self, body_from_local: np.ndarray) -> "RigidMotion":
        """The same motion with another coordinate frame (4, 4) fixed to the body."""
        turn, origin = body_from_local[:3, :3], body_from_local[:3, 3]
        shape = (self.shape - origin) @ turn
        return RigidMotion(shape, self.poses @ body_from_local, self.spreads, self.weights)


def fit_poses(shape: np.ndarray, points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The rigid motions that bring a shape closest to the points of each frame.

    Args:
        shape: (K, 3) positions on the body, metres.
        points: (F, K, 3) positions in each frame, metres; any finite value where the weight is 0.
        weights: (F, K) weights of the points.

    Returns:
        (F, 4, 4) least-squares poses; NaN for frames with fewer than `FEWEST_POINTS` weighted
        points.
    """
    enough = (weights > 0).sum(1) >= FEWEST_POINTS
    poses = np.full((len(points), 4, 4), np.nan)
    poses[enough] = rigid_fit(shape, points[enough], weights[enough])
    return poses


def procrustes(points: np.ndarray, held: np.ndarray) -> RigidMotion:
    """Finds shape and motion of a body, and how steady each of its points is.

    Points are weighted by their steadiness over time; in each frame, outliers are weighted down
    (Cauchy). Without noise the result is exact.

    Args:
        points: (F, K, 3) metres; NaN where a point was not seen.
        held: (K,) bool: points that may determine the poses.

    Returns:
        The motion; the body's coordinate frame is that of the frame with the most points.
    """
    seen = np.isfinite(points.sum(-1))  # (F, K)
    filled = np.where(seen[..., None], points, 0.0)
    shape = points[int((seen & held).sum(1).argmax())].copy()
    trust = np.where(seen, 1.0, 0.0)
    weights = trust * (held & np.isfinite(shape).all(-1))
    poses = fit_poses(np.nan_to_num(shape), filled, weights)
    for _ in range(ROUNDS):
        local = moved(inverse(poses), points)  # (F, K, 3)
        shape = _means(local, trust)
        away = np.linalg.norm(local - shape, axis=-1)  # (F, K)
        spreads = _spreads(away, held)
        trust = _trust(seen, away / spreads)
        weights = trust * (held & np.isfinite(spreads)) / spreads**2
        before, poses = poses, fit_poses(np.nan_to_num(shape), filled, weights)
        if np.nanmax(np.abs(poses - before), initial=0.0) < 1e-12:
            break
    return RigidMotion(shape, poses, spreads, weights)


def _means(local: np.ndarray, trust: np.ndarray) -> np.ndarray:
    """(K, 3) weighted means over the frames that see a point; NaN where none does."""
    known = np.isfinite(local.sum(-1))  # (F, K)
    counted = np.where(known, trust, 0.0)
    total = counted.sum(0)[:, None]  # (K, 1)
    sums = np.einsum("fk,fkc->kc", counted, np.where(known[..., None], local, 0.0))
    return np.divide(sums, total, out=np.full_like(sums, np.nan), where=total > 0)


def _spreads(away: np.ndarray, held: np.ndarray) -> np.ndarray:
    """(K,) robust standard deviations along an axis from lengths (F, K)."""
    known = np.isfinite(away)
    lengths = np.ma.median(np.ma.array(np.where(known, away, 0.0), mask=~known), axis=0)
    spreads = np.ma.filled(lengths / MEDIAN_LENGTH, np.inf)
    steady = spreads[held & np.isfinite(spreads)]
    floor = STEADIEST * np.quantile(steady, STEADY_QUARTER) if len(steady) else 0.0
    return np.maximum(spreads, max(float(floor), SPREAD_FLOOR))


def _trust(seen: np.ndarray, normed: np.ndarray) -> np.ndarray:
    """(F, K) Cauchy weights of lengths in units of their spread; 0 for what is not seen."""
    lengths = np.where(np.isfinite(normed), normed, 0.0)
    return np.where(seen, 1.0 / (1.0 + (lengths / 3.0) ** 2), 0.0)
