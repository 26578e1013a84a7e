"""Values of poses that are known for a few, and found for all others by kernel ridge regression."""

import numpy as np

from ico3d.rig.quaternions import Array, normalized

MOST_KNOWN = 256
"""Known poses that are used at most: the effort at first grows with the cube of their number."""
REACH = 1.25
"""Width of the kernel, over the root mean square distance of the known poses from their mean."""
RIDGE = 0.01
"""What is added to the likeness of a known pose and itself, as its values are not exact."""


class PoseRegression:
    """K values as a smooth function of the pose.

    At a known pose they are nearly those that are known, far from all known poses they are the
    known ones' mean, and they never leave the range of the known ones.
    """

    def __init__(self, known: Array, values: Array, width: float):
        """Solves for the weights of the known poses.

        Args:
            known: (P, J, 4) local rotation of each joint in the known poses, wxyz.
            values: (P, K) of the known poses.
            width: Of the kernel, as `kernel_width` gives it.
        """
        values = values.astype(np.float64)
        self._places = features(known)  # (P, 3·J)
        self._squares = np.square(self._places).sum(1)  # (P,)
        self._width = width
        self._mean = values.mean(0)  # (K,)
        self._range = values.min(0), values.max(0)  # (K,) each
        likeness = self._likeness(self._places) + RIDGE * np.eye(len(values))  # (P, P)
        self._weights: Array = np.linalg.solve(likeness, values - self._mean)  # (P, K)

    def at(self, rotations: Array) -> Array:
        """(K,) values of a pose, of which (J, 4) are the local rotations wxyz."""
        found: Array = self._mean + self._likeness(features(rotations)[None])[0] @ self._weights
        return found.clip(*self._range)

    def _likeness(self, places: Array) -> Array:
        """(Q, P) likeness of poses with features (Q, 3·J) to the known ones, 1 where they agree."""
        apart = np.square(places).sum(1)[:, None] + self._squares - 2 * places @ self._places.T
        return np.exp(-np.maximum(apart, 0) / (2 * self._width**2))


def kernel_width(rotations: Array) -> float:
    """Width of the kernel for known poses (P, M, 4), in units of their features.

    It depends on how far poses lie apart, not on how many there are: a denser recording tells more
    about the same movements.
    """
    places = features(rotations)  # (P, 3·M)
    spread = float(np.sqrt(np.square(places - places.mean(0)).sum(1).mean()))
    return max(REACH * spread, 1e-6) if spread > 0 else 1.0


def features(rotations: Array) -> Array:
    """(..., 3·J) features of poses (..., J, 4): sin(angle / 2) times the axis of each rotation."""
    quats = normalized(rotations)
    signed = np.where(quats[..., :1] < 0, -quats, quats)[..., 1:]  # (..., J, 3)
    return signed.reshape(*signed.shape[:-2], -1)
