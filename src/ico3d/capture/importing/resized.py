"""A capture whose pictures are scaled down when they are read."""

import numpy as np

from ico3d.capture.capture import Capture, Sound
from ico3d.capture.extras import opencv
from ico3d.capture.finding import Finding
from ico3d.capture.smplx import SmplX
from ico3d.common.camera import Camera
from ico3d.errors import SettingsError


class ResizedCapture(Capture):
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
        self.whole = capture
        self.kind, self.path, self.shows = capture.kind, capture.path, capture.shows
        self.fps, self.num_frames = capture.fps, capture.num_frames
        self.split, self.blendshape_names = capture.split, capture.blendshape_names
        self.cameras = tuple(_resized(camera, height) for camera in capture.cameras)

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether the wrapped recording has the picture."""
        return self.whole.has_image(camera, frame)

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether the wrapped recording has a mask of the person."""
        return self.whole.has_mask(camera, frame)

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The picture of a view; each pixel is the mean of those it replaces."""
        return self._shrunk(self.whole.image(camera, frame), camera)

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask of the person, with values between 0 and 1 along the edge."""
        return self._shrunk(self.whole.mask(camera, frame), camera)

    def head_mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask for `psnr_mask`, in the size of the pictures."""
        return self._shrunk(self.whole.head_mask(camera, frame), camera)

    def background(self, camera: int) -> np.ndarray | None:
        """What the camera sees without the person."""
        return self._shrunk(self.whole.background(camera), camera)

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) landmarks in pixels of the smaller picture."""
        marks = self.whole.landmarks(camera, frame)
        small, large = self.cameras[camera], self.whole.cameras[camera]
        scale = (small.width / large.width, small.height / large.height)
        return None if marks is None else marks * scale

    def landmarks_3d(self, frame: int) -> np.ndarray | None:
        """(68, 3) landmarks of the wrapped capture."""
        return self.whole.landmarks_3d(frame)

    def audio(self) -> Sound | None:
        """The sound of the wrapped capture."""
        return self.whole.audio()

    def world_from_head(self, frame: int) -> np.ndarray | None:
        """(4, 4) head pose of the wrapped capture."""
        return self.whole.world_from_head(frame)

    def eyes(self, frame: int) -> np.ndarray | None:
        """(7,) eye values of the wrapped capture."""
        return self.whole.eyes(frame)

    def blendshapes(self, frame: int) -> np.ndarray | None:
        """Blendshape weights of the wrapped capture."""
        return self.whole.blendshapes(frame)

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) surface points of the wrapped capture's head, in head space."""
        return self.whole.head_points(frame)

    def world_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) surface points of the wrapped capture's body, in the world."""
        return self.whole.world_points(frame)

    def whole_body_points(self, frame: int) -> np.ndarray | None:
        """(133, 3) annotated points of the wrapped capture, metres."""
        return self.whole.whole_body_points(frame)

    def smplx(self, frame: int) -> SmplX | None:
        """SMPL-X parameters of the wrapped capture."""
        return self.whole.smplx(frame)

    def inspect(self) -> list[Finding]:
        """Findings about the files of the wrapped capture."""
        return self.whole.inspect()

    @property
    def provenance(self) -> dict:
        """The provenance of the wrapped capture."""
        return self.whole.provenance

    def _shrunk(self, picture: np.ndarray | None, camera: int) -> np.ndarray | None:
        """A picture (H, W, ...) in the size of its camera."""
        lens = self.cameras[camera]
        if picture is None or picture.shape[:2] == (lens.height, lens.width):
            return picture
        cv2 = opencv("scaling pictures")
        # Means of values in [0, 1] may leave it by a rounding error.
        small = cv2.resize(picture, (lens.width, lens.height), interpolation=cv2.INTER_AREA)
        return np.clip(small, 0.0, 1.0)


def _resized(camera: Camera, height: int) -> Camera:
    """A camera with at most this many rows."""
    if camera.height <= height:
        return camera
    return camera.resized(max(1, round(camera.width * height / camera.height)), height)
