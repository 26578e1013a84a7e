"""The region of a head model that is drawn on a body, and where the body may not be."""

from dataclasses import dataclass

import numpy as np

from ico3d.errors import ModelError

CHIN, JAW_CORNERS, JAW_ENDS, BROWS, BRIDGE = 8, (4, 12), (0, 16), slice(17, 27), 27
JAW, EYES, MOUTH = slice(2, 15), slice(36, 48), slice(48, 68)
"""Indices of Multi-PIE landmarks along the jaw, of lids and of lips; so are the names above."""
BELOW_JAW = 0.2
"""How far below the jaw line the head's region ends: a chin goes down as a mouth opens.

This length and those below are relative to the height of the face, from chin to brows.
"""
BEHIND_EARS = 0.3
"""How far behind the ends of the jaw line the region ends: cameras in front see nothing there."""
BEFORE_NOSE = 0.2
"""How far before the foremost landmark Gaussians can belong to the head."""
FACE_RADIUS = 0.6
"""Radius of the sphere about the landmarks' centre in which no body may be."""
JAW_RADIUS = 0.13
"""Radius of the spheres about landmarks of the jaw in which no body may be."""


@dataclass(frozen=True)
class HeadRegion:
    """The part of canonical head space that belongs to the head model.

    Attributes:
        forward: (3,) direction in which the face looks, of length 1.
        under: (3,) normal, of length 1, of a plane below the lower jaw; it points into the head.
        under_at: Offset of this plane: the region is where x · under > under_at, metres.
        behind_at: The region is where x · forward > behind_at, metres.
        front_at: Where x · forward > front_at, metres, nothing belongs to the face.
        spheres: (S, 4) centres and radii in metres of spheres about the face and along the jaw, in
            which no body may be.
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
            ModelError: If the landmarks do not span a face.
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
        """(P,) distance in metres of points (P, 3) from the border; negative outside the region."""
        return np.minimum(
            points @ self.under - self.under_at, points @ self.forward - self.behind_at
        )

    def floating(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool: whether points (P, 3) hover before the face.

        Some Gaussians do so if all recording cameras were in front: no picture shows that there is
        nothing at their place.
        """
        return points @ self.forward > self.front_at

    def trespassing(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool: whether points (P, 3) are where no body may be."""
        away = np.linalg.norm(points[:, None] - self.spheres[:, :3], axis=2)  # (P, S)
        return (away < self.spheres[:, 3]).any(1)


def _across(direction: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
    """The part (3,) of a direction that is orthogonal to two other directions (3,)."""
    basis, _ = np.linalg.qr(np.stack(others, 1))  # (3, 2)
    return direction - basis @ (basis.T @ direction)


def _unit(vector: np.ndarray) -> np.ndarray:
    length = float(np.linalg.norm(vector))
    if not length > 1e-9:
        raise ModelError("the head's landmarks are no face: track its capture again and retrain.")
    return vector / length
