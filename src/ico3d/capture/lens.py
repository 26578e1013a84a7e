"""Lenses with distortion, and the removal of distortion from pictures."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ico3d.capture.box import Box, cut_out
from ico3d.capture.extras import opencv
from ico3d.errors import CaptureError

PURPOSE = "straightening the pictures of a lens with distortion"
COEFFICIENTS = (0, 4, 5, 8, 12, 14)
"""Numbers of distortion coefficients that OpenCV's models may have."""
LONGEST = 1e9
"""Focal length in pixels that no lens has."""
MOST_CHANGE = 3.0
"""Largest factor by which undistortion may change a focal length before the lens is refused."""


@dataclass(frozen=True)
class Lens:
    """A camera without its pose: lens and sensor as calibrated.

    Attributes:
        name: Name of the camera, for errors.
        width: Picture width in pixels.
        height: Picture height in pixels.
        intrinsics: (3, 3) fx, fy, cx, cy in pixels, pixel centres at +0.5.
        distortion: OpenCV's k1, k2, p1, p2, k3, …; empty or zero for a lens without distortion.
    """

    name: str
    width: int
    height: int
    intrinsics: np.ndarray
    distortion: tuple[float, ...] = ()

    def __post_init__(self):
        """Checks the numbers.

        Raises:
            CaptureError: If no lens can have them.
        """
        matrix = np.asarray(self.intrinsics, np.float64)
        values = np.array(self.distortion, np.float64)
        if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
            raise CaptureError(f"camera {self.name}: the intrinsics are no finite 3x3 matrix.")
        if not all(0 < length < LONGEST for length in (matrix[0, 0], matrix[1, 1])):
            raise CaptureError(
                f"camera {self.name}: the focal lengths must be above 0 and below {LONGEST:g} "
                "pixels."
            )
        if self.width < 1 or self.height < 1:
            raise CaptureError(
                f"camera {self.name}: pictures of {self.width}x{self.height} pixels."
            )
        if len(values) not in COEFFICIENTS or not np.isfinite(values).all():
            raise CaptureError(
                f"camera {self.name}: the distortion must be 4, 5, 8, 12 or 14 finite numbers."
            )
        plain = np.diag([matrix[0, 0], matrix[1, 1], 1.0])
        plain[:2, 2] = matrix[:2, 2]
        object.__setattr__(self, "intrinsics", plain)

    @property
    def bends(self) -> bool:
        """Whether the lens has any distortion."""
        return any(self.distortion)

    @cached_property
    def straight_intrinsics(self) -> np.ndarray:
        """(3, 3) intrinsics of the pinhole camera to which undistorted pictures belong.

        This is OpenCV's optimal matrix for pictures that show recorded pixels only. With the matrix
        of the calibration, a large k3 would repeat parts of the picture in the corners.

        Raises:
            CaptureError: If the distortion cannot be undone.
            MissingExtraError: If the lens has distortion and OpenCV is not installed.
        """
        if not self.bends:
            return self.intrinsics
        size = (self.width, self.height)
        matrix, _ = opencv(PURPOSE).getOptimalNewCameraMatrix(
            _opencv_matrix(self.intrinsics), self._coefficients, size, 0, size
        )
        change = np.diag(matrix)[:2] / np.diag(self.intrinsics)[:2]
        sane = np.isfinite(matrix).all() and (change > 1 / MOST_CHANGE).all()
        if not sane or (change > MOST_CHANGE).any():
            raise CaptureError(
                f"camera {self.name}: its distortion cannot be undone; calibrate it again."
            )
        return _our_matrix(matrix)

    def straightened(self, picture: np.ndarray, box: Box | None = None) -> np.ndarray:
        """Undistorts a picture (H, W, ...), uint8 or float32.

        Args:
            picture: The whole picture as recorded.
            box: The part of the undistorted picture that is wanted; None for all of it.
        """
        if not self.bends:
            return cut_out(picture, box)
        cv2 = opencv(PURPOSE)
        box = box or Box(0, 0, self.width, self.height)
        matrix = _opencv_matrix(self.straight_intrinsics)
        matrix[:2, 2] -= box.left, box.top
        maps = cv2.initUndistortRectifyMap(
            _opencv_matrix(self.intrinsics),
            self._coefficients,
            None,
            matrix,
            (box.width, box.height),
            cv2.CV_16SC2,
        )  # (h, w, 2), (h, w)
        return cv2.remap(picture, *maps, cv2.INTER_LINEAR)

    def straightened_points(self, pixels: np.ndarray) -> np.ndarray:
        """Undistorts pixel positions (P, 2)."""
        if not self.bends or not len(pixels):
            return np.asarray(pixels, np.float64)
        moved = opencv(PURPOSE).undistortPoints(
            np.asarray(pixels, np.float64)[:, None] - 0.5,
            _opencv_matrix(self.intrinsics),
            self._coefficients,
            P=_opencv_matrix(self.straight_intrinsics),
        )  # (P, 1, 2)
        return moved[:, 0] + 0.5

    def resized(self, width: int, height: int) -> "Lens":
        """The same lens for pictures of another size in pixels."""
        scale = np.diag([width / self.width, height / self.height, 1.0])
        return Lens(self.name, width, height, scale @ self.intrinsics, self.distortion)

    @property
    def _coefficients(self) -> np.ndarray:
        return np.array(self.distortion, np.float64)


def _opencv_matrix(intrinsics: np.ndarray) -> np.ndarray:
    """OpenCV counts from the middle of the first pixel, we from its corner."""
    matrix = intrinsics.copy()
    matrix[:2, 2] -= 0.5
    return matrix


def _our_matrix(intrinsics: np.ndarray) -> np.ndarray:
    matrix = intrinsics.copy()
    matrix[:2, 2] += 0.5
    return matrix
