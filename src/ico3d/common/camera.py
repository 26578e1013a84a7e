"""The pinhole camera that every room shares."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Camera:
    """A pinhole camera in OpenCV axes: x right, y down, z forward; pixel centres at +0.5.

    Attributes:
        width: Image width in pixels.
        height: Image height in pixels.
        intrinsics: (3, 3) float64, fx, fy, cx, cy in pixels; no skew.
        world_to_camera: (4, 4) float64 rigid transform, metres.
        name: Name used in reports and folder names.
    """

    width: int
    height: int
    intrinsics: np.ndarray
    world_to_camera: np.ndarray
    name: str = "0"

    def __post_init__(self):
        """Checks shapes and finiteness.

        Raises:
            ValueError: If a matrix has a wrong shape or holds a value that is not finite.
        """
        for field, shape in (("intrinsics", (3, 3)), ("world_to_camera", (4, 4))):
            value = np.asarray(getattr(self, field), np.float64)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"camera {self.name}: {field} must be a finite {shape} matrix")
            object.__setattr__(self, field, value)

    @property
    def camera_to_world(self) -> np.ndarray:
        """(4, 4) inverse of `world_to_camera`."""
        rotation, translation = self.world_to_camera[:3, :3], self.world_to_camera[:3, 3]
        inverse = np.eye(4)
        inverse[:3, :3] = rotation.T
        inverse[:3, 3] = -rotation.T @ translation
        return inverse

    def moved(self, world_from_local: np.ndarray) -> "Camera":
        """The same camera, given in a local frame instead of the world.

        Args:
            world_from_local: (4, 4) rigid transform from the local frame to the world, metres.

        Returns:
            A camera whose `world_to_camera` is W2C · world_from_local, so that the camera projects
            points of the local frame.
        """
        return Camera(
            self.width,
            self.height,
            self.intrinsics,
            self.world_to_camera @ np.asarray(world_from_local, np.float64),
            self.name,
        )

    def resized(self, width: int, height: int) -> "Camera":
        """The same camera at another resolution in pixels; the intrinsics are scaled to match."""
        scale = np.diag([width / self.width, height / self.height, 1.0])
        return Camera(width, height, scale @ self.intrinsics, self.world_to_camera, self.name)

    def cropped(self, left: int, top: int, width: int, height: int) -> "Camera":
        """The camera whose picture is a rectangle of this camera's picture.

        Args:
            left: Pixel columns cut off on the left; a negative number adds columns there.
            top: Pixel rows cut off at the top; a negative number adds rows there.
            width: Pixel columns of the rectangle.
            height: Pixel rows of the rectangle.
        """
        intrinsics = self.intrinsics.copy()
        intrinsics[:2, 2] -= (left, top)
        return Camera(width, height, intrinsics, self.world_to_camera, self.name)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Projects world points.

        Args:
            points: (..., 3) points in the world, metres.

        Returns:
            Pixel coordinates (..., 2), where pixel centres lie at +0.5, and depths (...,) along the
            camera's z axis in metres.
        """
        points = np.asarray(points, np.float64)
        local = points @ self.world_to_camera[:3, :3].T + self.world_to_camera[:3, 3]  # (..., 3)
        image = local @ self.intrinsics.T  # (..., 3)
        return image[..., :2] / image[..., 2:], local[..., 2]


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)) -> np.ndarray:
    """World-to-camera matrix (4, 4) of a camera at `eye` looking at `target`, in OpenCV axes."""
    eye, target = np.asarray(eye, float), np.asarray(target, float)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, np.asarray(up, float))
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])  # (3, 3)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = -rotation @ eye
    return matrix
