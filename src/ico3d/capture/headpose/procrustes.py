"""Rigid motion of points of which some are missing or wrong, and how steady each of them is."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.headpose.shape import inverse, moved, rigid_fit

FEWEST_POINTS = 6
"""Points that a frame must show; fewer may lie on a line."""
ROUNDS = 40
SPREAD_FLOOR = 1e-9
"""Least standard deviation of a point in metres: points without any noise have finite weights."""
STEADY_QUARTER, STEADIEST = 0.25, 0.5
"""No point counts as steadier than half of what the steadiest quarter stray: it would be alone."""
MEDIAN_LENGTH = 1.538
"""Median length of a vector whose three components are normal with deviation 1."""


@dataclass(frozen=True)
class RigidMotion:
    """Generalised Procrustes analysis of points over time.

    Attributes:
        shape: (K, 3) where the points are on the body, metres; NaN for those never seen.
        poses: (F, 4, 4) frame from body; NaN for frames that show too little.
        spreads: (K,) metres by which each point strays along an axis; infinite if never seen.
        weights: (F, K) inverse variances that the poses were fitted with; 0 where not seen.
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
    """The rigid motions that take a shape to where its points are seen.

    Args:
        shape: (K, 3) metres.
        points: (F, K, 3) in each frame; anything finite where the weight is 0.
        weights: (F, K).

    Returns:
        (F, 4, 4) least-squares poses; NaN for frames with fewer than `FEWEST_POINTS` weights.
    """
    enough = (weights > 0).sum(1) >= FEWEST_POINTS
    poses = np.full((len(points), 4, 4), np.nan)
    poses[enough] = rigid_fit(shape, points[enough], weights[enough])
    return poses


def procrustes(points: np.ndarray, held: np.ndarray) -> RigidMotion:
    """Finds shape and motion of a body, and how steady each of its points is.

    Points count by how little they stray, measured over time; in each frame, those that are far
    off count less (Cauchy). Without noise the result is exact.

    Args:
        points: (F, K, 3) metres; NaN where a point was not seen.
        held: (K,) bool: points that may hold the body; the others only follow.

    Returns:
        The motion; the body's coordinate frame is that of the frame with most points.
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
