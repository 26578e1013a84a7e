"""Displacements of a head's Gaussians: skin goes where the landmarks of the face go.

In the paper a head's Gaussians stand still and change colour and opacity. A chin that goes down as
the mouth opens is then a chin that fades here and appears there, and is soft on the way.

Sound does not tell all of where lips are. So skin is learnt where landmarks were seen to be, and
what an expression tells of that place decides where it is drawn: a little off at times, but sharp.
"""

from dataclasses import dataclass, replace

import numpy as np

from ico3d.common.expression import MOVE_HIDDEN
from ico3d.head.blending.distil import CoefficientNetwork, distil

NOISE, COPIES, STEPS = 0.3, 20, 1500
"""Noise in deviations of each value of an expression, copies of each frame, and steps of the fit of
the network from expressions: 1.03 mm of error on frames that were not seen, where linear regression
has 1.22 (docs/choices.md)."""
NEAREST, FARTHEST = 0.004, 0.016
"""Least and largest reach of a landmark in metres, else its distance from its neighbour."""
STILL = 1.5
"""How many reaches from a landmark skin moves half as far as the landmark does."""
LEAST_FRAMES = 16
"""Fewer frames with landmarks do not tell how a face moves."""
LEAST_MOTION = 1e-6
"""Root mean square in metres below which landmarks stand still."""


@dataclass(frozen=True)
class Displacement:
    """Displacements D(x) = Σ_m c_m · D_m(x) of a face's skin.

    Attributes:
        landmarks: (P, 3) where landmarks are on average, metres in canonical head space.
        modes: (M, P, 3) metres by which landmarks move where a coefficient is 1; the strongest
            first.
        mean: (P, 3) how far landmarks are on average from where `landmarks` has them.
    """

    landmarks: np.ndarray
    modes: np.ndarray
    mean: np.ndarray

    def coefficients(self, motion: np.ndarray) -> np.ndarray:
        """(F, M) float32 of frames in which landmarks moved by (F, P, 3); NaN where that is.

        In the frames that the modes were found in they have a mean of 0 and a root mean square
        of 1.
        """
        axes = self.modes.reshape(len(self.modes), -1)  # (M, 3 · P)
        axes = axes / np.square(axes).sum(1, keepdims=True)
        found = (motion - self.mean).reshape(len(motion), -1) @ axes.T  # (F, M)
        return found.astype(np.float32)

    def spread(self, points: np.ndarray) -> np.ndarray:
        """(M, N, 3) displacements D_m of points (N, 3), metres.

        They are means of those of the landmarks near a point, less with the distance from the
        nearest one.
        """
        between = self.landmarks[:, None] - self.landmarks  # (P, P, 3)
        apart = np.linalg.norm(between, axis=-1) + np.diag(np.full(len(between), np.inf))
        reach = np.clip(apart.min(1), NEAREST, FARTHEST)  # (P,)
        away = np.linalg.norm(points[:, None] - self.landmarks, axis=-1) / reach  # (N, P)
        nearest = away.min(1, keepdims=True)  # (N, 1)
        weights = np.exp(0.5 * (nearest**2 - away**2))
        weights /= weights.sum(1, keepdims=True) * (1 + (nearest / STILL) ** 4)
        return np.einsum("np,mpc->mnc", weights, self.modes)


def principal(landmarks: np.ndarray, motion: np.ndarray, count: int) -> Displacement | None:
    """The principal components of how landmarks move.

    Args:
        landmarks: (P, 3) where landmarks are on average.
        motion: (F, P, 3) how far they are from there in frames, metres; NaN where it is not known.
        count: Largest number M of displacements.

    Returns:
        None where too few frames are known, or nothing moves.
    """
    known = np.isfinite(motion).all((1, 2))
    if known.sum() < LEAST_FRAMES:
        return None
    flat = motion[known].reshape(known.sum(), -1)  # (F', 3 · P)
    mean = flat.mean(0)  # (3 · P,)
    _, sizes, axes = np.linalg.svd(flat - mean, full_matrices=False)
    sizes = sizes[:count] / np.sqrt(len(flat))
    sizes = sizes[sizes > LEAST_MOTION * np.sqrt(motion.shape[1])]
    if not len(sizes):
        return None
    modes = (axes[: len(sizes)] * sizes[:, None]).reshape(len(sizes), -1, 3)
    return Displacement(landmarks, modes, mean.reshape(-1, 3))


def told(
    expressions: np.ndarray, coefficients: np.ndarray, sizes: np.ndarray
) -> CoefficientNetwork:
    """Fits the network from expressions to coefficients.

    It learns from copies of the frames with noise: what is alike in them, instead of each by heart.

    Args:
        expressions: (F, B) expressions of frames.
        coefficients: (F, M) coefficients of the same frames.
        sizes: (M,) positive; by how much an error of each coefficient counts.
    """
    rng = np.random.default_rng(0)
    size = NOISE * expressions.std(0)  # (B,)
    noisy = [expressions + size * rng.normal(size=expressions.shape) for _ in range(COPIES)]
    inputs = np.concatenate(noisy).astype(np.float32)  # (F · COPIES, B)
    targets = np.concatenate([coefficients * sizes] * COPIES)  # (F · COPIES, M)
    network = distil(inputs, targets, MOVE_HIDDEN, STEPS, seed=0)
    return replace(network, w2=network.w2 / sizes, b2=network.b2 / sizes)
