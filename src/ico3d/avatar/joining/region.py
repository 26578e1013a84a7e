"""Which part of a head model is drawn on a body, and what the body must keep clear of."""

from dataclasses import dataclass

import numpy as np

from ico3d.errors import ModelError

CHIN, JAW_CORNERS, JAW_ENDS, BROWS, BRIDGE = 8, (4, 12), (0, 16), slice(17, 27), 27
JAW = slice(2, 15)
"""Multi-PIE landmarks."""
BELOW_JAW = 0.2
"""How far under the jaw line the head ends: an open mouth reaches there. All lengths here are
relative to the height of the face, from chin to brows."""
BEHIND_EARS = 0.3
"""How far behind the ends of the jaw line it ends; beyond, cameras in front see nothing."""
BEFORE_NOSE = 0.2
"""How far before the foremost landmark the head's Gaussians may be."""
FACE_RADIUS = 0.6
JAW_RADIUS = 0.13


@dataclass(frozen=True)
class HeadRegion:
    """The part of canonical head space that belongs to the head model.

    Attributes:
        forward: (3,) where the face looks, of length 1.
        under: (3,) of length 1, and `under_at`: the head lies where x · under > under_at; that
            plane follows the lower jaw.
        under_at: Metres.
        behind_at: Metres; the head lies where x · forward > behind_at.
        front_at: Metres; farther along `forward` nothing is a part of a face.
        spheres: (S, 4) centre and radius: the face, and along the jaw; the body keeps clear.
    """

    forward: np.ndarray
    under: np.ndarray
    under_at: float
    behind_at: float
    front_at: float
    spheres: np.ndarray

    @staticmethod
    def around(landmarks: np.ndarray) -> "HeadRegion":
        """The region of a face.

        Args:
            landmarks: (68, 3) Multi-PIE landmarks in canonical head space.

        Raises:
            ModelError: If they are no face.
        """
        chin, brows = landmarks[CHIN], landmarks[BROWS].mean(0)
        height = float(np.linalg.norm(brows - chin))
        ends = landmarks[list(JAW_ENDS)]  # (2, 3)
        across = ends[1] - ends[0]
        forward = _unit(_across(landmarks[BRIDGE] - ends.mean(0), [across, brows - chin]))
        corners = landmarks[list(JAW_CORNERS)]  # (2, 3)
        under = _unit(np.cross(corners[1] - corners[0], chin - corners.mean(0)))
        under = under if under @ (brows - chin) > 0 else -under
        centre = landmarks.mean(0)
        spheres = [[*centre, FACE_RADIUS * height]]
        spheres += [[*point, JAW_RADIUS * height] for point in landmarks[JAW]]
        return HeadRegion(
            forward,
            under,
            float(under @ chin - BELOW_JAW * height),
            float(ends.mean(0) @ forward - BEHIND_EARS * height),
            float((landmarks @ forward).max() + BEFORE_NOSE * height),
            np.array(spheres),
        )

    def depth(self, points: np.ndarray) -> np.ndarray:
        """(P,) how far points (P, 3) are inside, metres; outside it is negative."""
        return np.minimum(
            points @ self.under - self.under_at, points @ self.forward - self.behind_at
        )

    def floating(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool: whether points (P, 3) hover before the face.

        Where all cameras are in front, some do: pictures do not tell that nothing is there.
        """
        return points @ self.forward > self.front_at

    def trespassing(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool: whether points (P, 3) are where the body keeps clear."""
        away = np.linalg.norm(points[:, None] - self.spheres[:, :3], axis=2)  # (P, S)
        return (away < self.spheres[:, 3]).any(1)


def _across(direction: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
    """What of a direction (3,) is orthogonal to others."""
    basis, _ = np.linalg.qr(np.stack(others, 1))  # (3, 2)
    return direction - basis @ (basis.T @ direction)


def _unit(vector: np.ndarray) -> np.ndarray:
    length = float(np.linalg.norm(vector))
    if not length > 1e-9:
        raise ModelError("the head's landmarks are no face: track its capture again and retrain.")
    return vector / length
