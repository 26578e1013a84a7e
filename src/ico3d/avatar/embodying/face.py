"""A face in canonical head space: where its cheeks, its crown and its back edge are."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.face.region import BROWS, CHIN, HeadRegion

CHEEKS = ((2, 31, 36, 48), (14, 35, 45, 54))
"""Multi-PIE landmarks about the right and the left cheek: jaw, nostril, eye, corner of the mouth.
"""
CHEEK = 0.16
"""Radius of a cheek's middle, relative to the height of the face."""
RIM = 0.25
"""Width of the band of hair at the back edge of a face, relative to the height of the face."""
CROWN = 0.1
"""How far above the brows that band begins, relative to the height of the face."""
SKULL = 0.68
"""Radius of a skull seen from the side, relative to the height of the face: it is about a circle.

Hair outside, such as a tail, is left out: it is of the person on the body alone.
"""
MIDDLE = 0.65
"""How far behind the brows the middle of that circle is, relative to the height of the face."""
NAPE = 1.3
"""How many times as far the circle reaches below its middle, towards the neck."""


@dataclass(frozen=True)
class Face:
    """A face in canonical head space of the body.

    Attributes:
        landmarks: (68, 3) landmarks, metres.
        region: The part of the space that belongs to the head.
    """

    landmarks: np.ndarray
    region: HeadRegion

    @staticmethod
    def of(landmarks: np.ndarray) -> "Face":
        """The face with these landmarks (68, 3)."""
        return Face(landmarks, HeadRegion.around(landmarks))

    @property
    def height(self) -> float:
        """Distance in metres from the chin to the brows."""
        return float(np.linalg.norm(self.landmarks[BROWS].mean(0) - self.landmarks[CHIN]))

    @property
    def middle(self) -> np.ndarray:
        """(3,) the landmarks' mean."""
        return self.landmarks.mean(0)

    @property
    def _up(self) -> np.ndarray:
        """(3,) direction of length 1 from the chin to the brows, square to where the face looks."""
        up = self.landmarks[BROWS].mean(0) - self.landmarks[CHIN]
        up = up - self.region.forward * (up @ self.region.forward)
        return up / np.linalg.norm(up)

    def on_cheeks(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool, which of points (P, 3) lie on a cheek."""
        middles = np.array([self.landmarks[list(cheek)].mean(0) for cheek in CHEEKS])  # (2, 3)
        away = np.linalg.norm(points[:, None] - middles, axis=2)  # (P, 2)
        return away.min(1) < CHEEK * self.height

    def in_crown(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool, which of points (P, 3) are above the ears, at any depth."""
        return (points - self.landmarks[BROWS].mean(0)) @ self._up > CROWN * self.height

    def beyond(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool, which of points (P, 3) are behind a skull and outside it."""
        away = (points - self.landmarks[BROWS].mean(0)) / self.height
        back, up = -away @ self.region.forward - MIDDLE, away @ self._up
        return (back > 0) & (np.hypot(back, np.where(up < 0, up / NAPE, up)) > SKULL)

    def on_back_edge(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool, which of points (P, 3) are above the ears and at the back edge of the head."""
        away = -self.behind(points)
        return self.in_crown(points) & (away > 0) & (away < RIM * self.height)

    def just_behind(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool, which of points (P, 3) are above the ears and behind that edge."""
        away = self.behind(points)
        return self.in_crown(points) & (away > 0) & (away < RIM * self.height)

    def behind(self, points: np.ndarray) -> np.ndarray:
        """(P,) metres by which points (P, 3) are behind the plane behind the ears."""
        return self.region.behind_at - points @ self.region.forward
