"""The space that a person's head fills, hair included, and which pixels show it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from PIL import Image, ImageDraw
from scipy.spatial import ConvexHull, Delaunay

from ico3d.capture.face.region import BROWS, CHIN, JAW_ENDS, HeadRegion
from ico3d.common.camera import Camera

MIDDLE = (0.0, 0.05, -0.15)
"""Middle of the skull from the middle of the jaw line's ends: to the left, up, to the front.

Lengths here and below are relative to the height of the face, from chin to brows.
"""
HALF_AXES = (0.85, 1.1, 1.1)
"""Half axes of skull and hair: across, upwards, to the front."""
AROUND_FACE = 1.1
"""The face's landmarks count this far from their middle: noses and chins end beyond them."""
DIRECTIONS = 400
"""Number of points on the skull."""


@dataclass(frozen=True)
class HeadSolid:
    """A convex solid about a head, from its hair down to where `HeadRegion` ends under the jaw.

    Attributes:
        corners: (V, 3) its corners in canonical head space, metres.
    """

    corners: np.ndarray

    @staticmethod
    def around(landmarks: np.ndarray) -> "HeadSolid":
        """The solid about a face.

        Args:
            landmarks: (68, 3) Multi-PIE landmarks in canonical head space.

        Raises:
            ModelError: If the landmarks do not span a face.
        """
        region = HeadRegion.around(landmarks)
        height = float(np.linalg.norm(landmarks[BROWS].mean(0) - landmarks[CHIN]))
        ends = landmarks[list(JAW_ENDS)]  # (2, 3)
        across = ends[1] - ends[0]
        across = across - region.forward * (across @ region.forward)
        across /= np.linalg.norm(across)
        up = np.cross(region.forward, across)
        up = up if up @ (landmarks[BROWS].mean(0) - landmarks[CHIN]) > 0 else -up
        axes = height * np.stack([across, up, region.forward])  # (3, 3)
        skull = ends.mean(0) + (np.array(MIDDLE) + HALF_AXES * _sphere(DIRECTIONS)) @ axes
        middle = landmarks.mean(0)
        face = middle + AROUND_FACE * (landmarks - middle)  # (68, 3)
        below = region.under * np.minimum(skull @ region.under - region.under_at, 0)[:, None]
        points = np.concatenate([skull - below, face])  # lifted onto the plane under the jaw
        return HeadSolid(points[ConvexHull(points).vertices])

    def holds(self, points: np.ndarray) -> np.ndarray:
        """(P,) bool: which points (P, 3) in canonical head space lie inside."""
        return self._cells.find_simplex(points) >= 0

    def box(self, camera: Camera) -> tuple[int, int, int, int] | None:
        """Left, top, right, bottom: the pixels of a picture that the solid covers.

        Args:
            camera: The camera in canonical head space.

        Returns:
            The box within the picture; None where the solid is not in the picture.
        """
        pixels, depths = camera.project(self.corners)  # (V, 2), (V,)
        if (depths <= 0).any():
            return None
        size = (camera.width, camera.height)
        left, top = np.floor(pixels.min(0)).clip(0, size).astype(int).tolist()
        right, bottom = np.ceil(pixels.max(0)).clip(0, size).astype(int).tolist()
        return (left, top, right, bottom) if left < right and top < bottom else None

    def covered(self, camera: Camera) -> np.ndarray:
        """(H, W) float32: 1 in the pixels whose rays meet the solid.

        Args:
            camera: The camera in canonical head space.
        """
        pixels, depths = camera.project(self.corners)  # (V, 2), (V,)
        picture = Image.new("L", (camera.width, camera.height))
        if (depths > 0).all():
            outline = pixels[ConvexHull(pixels).vertices] - 0.5
            ImageDraw.Draw(picture).polygon([*map(tuple, outline.tolist())], fill=1)
        return np.asarray(picture, np.float32)

    @cached_property
    def _cells(self) -> Delaunay:
        return Delaunay(self.corners)


def _sphere(count: int) -> np.ndarray:
    """(count, 3) points that are spread evenly over the unit sphere (Fibonacci's spiral)."""
    number = np.arange(count) + 0.5
    height = 1 - 2 * number / count
    turn = np.pi * (1 + 5**0.5) * number
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), height, radius * np.sin(turn)], 1)
