"""The depth cameras of a DNA-Rendering recording."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.decoding import decoded, unit
from ico3d.capture.dna.annotations import person
from ico3d.capture.poses import rigid, turned
from ico3d.capture.smc.file import SmcFile
from ico3d.errors import CaptureError


@dataclass(frozen=True)
class KinectCalibration:
    """One depth camera; pictures of depth cameras are not undistorted.

    Attributes:
        intrinsics: (3, 3) as stored in the file: pixel centres at whole numbers.
        distortion: (D,) OpenCV's distortion coefficients.
        camera_to_world: (4, 4) pose in the capture's world, metres.
    """

    intrinsics: np.ndarray
    distortion: np.ndarray
    camera_to_world: np.ndarray


class Kinect:
    """Depth, masks and calibration from the file `…_kinect.smc`."""

    def __init__(self, file: SmcFile, upright: np.ndarray):
        """Lists the depth cameras.

        Args:
            file: The file `…_kinect.smc`.
            upright: (3, 3) rotation from the world of the files to the capture's world.

        Raises:
            CaptureError: If the file is damaged.
        """
        self._file, self._upright = file, upright
        self.cameras: tuple[int, ...] = tuple(file.numbered("Kinect"))

    def calibration(self, camera: int) -> KinectCalibration:
        """Lens and pose of a depth camera.

        Raises:
            CaptureError: If there is no such camera, or the calibration is damaged.
        """
        inside = f"Calibration/Kinect/{camera:02d}"
        lens = self._file.numbers(f"{inside}/K", (3, 3))
        bent = self._file.numbers(f"{inside}/D", (None,))
        pose = self._file.numbers(f"{inside}/RT", (4, 4))
        if lens is None or bent is None or pose is None:
            raise CaptureError(f"{self._file.path}: Kinect {camera:02d} has no calibration.")
        place = rigid(pose, f"{self._file.path}: Kinect {camera:02d}")
        return KinectCalibration(lens, bent, turned(self._upright, place))

    def depth(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W) uint16 depth in the Kinect's own unit, as stored; None if missing."""
        return self._file.pixels(f"Kinect/{camera}/depth/{frame}")

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W) float32 mask, 1 on the person; None if missing."""
        inside = f"Kinect/{camera}/mask/{frame}"
        held = self._file.encoded(inside)
        return None if held is None else unit(person(decoded(held, f"{self._file.path}: {inside}")))
