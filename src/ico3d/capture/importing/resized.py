"""A capture whose pictures are scaled down when they are read."""

import numpy as np

from ico3d.capture.box import Box, cut_out
from ico3d.capture.capture import Capture
from ico3d.capture.extras import opencv
from ico3d.capture.parts.wrapped import WrappedCapture
from ico3d.common.camera import Camera
from ico3d.errors import SettingsError


class ResizedCapture(WrappedCapture):
    """A capture of any format with smaller pictures; all other data are unchanged.

    Attributes:
        whole: The wrapped capture, for methods that only its format has.
    """

    def __init__(self, capture: Capture, height: int):
        """Wraps an open capture.

        Args:
            capture: The capture; its cameras may differ in size.
            height: Upper limit of the pictures' height in pixels; smaller pictures stay as they
                are.

        Raises:
            SettingsError: If the height is below 1.
        """
        if height < 1:
            raise SettingsError(f"pictures cannot have a height of {height} pixels.")
        super().__init__(capture)
        self.cameras = tuple(_resized(camera, height) for camera in capture.cameras)

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The picture of a view; each pixel is the mean of those it replaces."""
        return self._shrunk(self.whole.image(camera, frame), camera)

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask of the person, with values between 0 and 1 along the edge."""
        return self._shrunk(self.whole.mask(camera, frame), camera)

    def head_mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask for `psnr_mask`, in the size of the pictures."""
        return self._shrunk(self.whole.head_mask(camera, frame), camera)

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of a picture in a box, uint8."""
        return self._shrunk(self.whole.image_bytes(camera, frame), camera, box)

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of a mask in a box, uint8."""
        return self._shrunk(self.whole.mask_bytes(camera, frame), camera, box)

    def head_mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the mask for `psnr_mask` in a box, uint8."""
        return self._shrunk(self.whole.head_mask_bytes(camera, frame), camera, box)

    def background(self, camera: int) -> np.ndarray | None:
        """What the camera sees without the person."""
        return self._shrunk(self.whole.background(camera), camera)

    def behind(self, camera: int, frame: int) -> np.ndarray | None:
        """What the camera sees in a frame without what the mask shows."""
        return self._shrunk(self.whole.behind(camera, frame), camera)

    def torso(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W, 4) what a portrait shows below the head."""
        return self._shrunk(self.whole.torso(camera, frame), camera)

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) landmarks in pixels of the smaller picture."""
        marks = self.whole.landmarks(camera, frame)
        small, large = self.cameras[camera], self.whole.cameras[camera]
        scale = (small.width / large.width, small.height / large.height)
        return None if marks is None else marks * scale

    def _shrunk(
        self, picture: np.ndarray | None, camera: int, box: Box | None = None
    ) -> np.ndarray | None:
        """A picture (H, W, ...) in the size of its camera, or its part in a box."""
        lens = self.cameras[camera]
        if picture is None:
            return None
        if picture.shape[:2] == (lens.height, lens.width):
            return cut_out(picture, box)
        cv2 = opencv("scaling pictures")
        size = (lens.width, lens.height)
        small: np.ndarray = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        if small.dtype != np.uint8:
            small = np.clip(small, 0.0, 1.0)  # means may leave [0, 1] by a rounding error
        return cut_out(small, box)


def _resized(camera: Camera, height: int) -> Camera:
    """A camera with at most this many rows."""
    if camera.height <= height:
        return camera
    return camera.resized(max(1, round(camera.width * height / camera.height)), height)
