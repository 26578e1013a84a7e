"""The head alone in a portrait: drawn over the recorded torso of each frame."""

import numpy as np

from ico3d.capture.box import Box
from ico3d.capture.capture import Capture
from ico3d.capture.parts.wrapped import WrappedCapture
from ico3d.errors import CaptureError


class HeadOverTorso(WrappedCapture):
    """A portrait as a recording of its head, before a background that holds the frame's torso.

    Papers on talking portraits compare such pictures: the head alone is drawn, over the recorded
    torso and the clean plate (TalkingGaussian, ER-NeRF). Masks are those of the head.
    """

    moves_behind = True

    def __init__(self, capture: Capture):
        """Wraps a portrait.

        Raises:
            CaptureError: If the capture has no clean plate, or no pictures of a torso.
        """
        super().__init__(capture)
        frames = range(capture.num_frames)
        first = next((frame for frame in frames if capture.has_image(0, frame)), None)
        self._plate = capture.background(0)
        if self._plate is None or first is None or capture.torso(0, first) is None:
            raise CaptureError(
                f"{capture.path} is no portrait with a clean plate (bc.jpg) and pictures of the "
                "torso (torso_imgs): train the whole person."
            )

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask of the head."""
        return self.whole.head_mask(camera, frame)

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the head's mask in a box, uint8."""
        return self.whole.head_mask_bytes(camera, frame, box)

    def behind(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W, 3) the frame's torso over the clean plate; None where the torso is missing."""
        torso = self.whole.torso(camera, frame)
        if torso is None or self._plate is None:
            return None
        cover = torso[..., 3:]  # (H, W, 1)
        return torso[..., :3] * cover + self._plate * (1 - cover)
