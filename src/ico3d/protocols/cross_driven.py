"""A head's recording with another sound: the cross-driven setting (paper, section 4.2)."""

import numpy as np

from ico3d.capture.capture import Capture, Sound
from ico3d.capture.parts.wrapped import WrappedCapture
from ico3d.errors import CaptureError


class CrossDriven(WrappedCapture):
    """Pictures, head poses and eyes of some frames, there and back, as long as another sound."""

    def __init__(self, capture: Capture, frames: tuple[int, ...], sound: Sound, name: str):
        """Takes the recording, its frames to repeat, and the sound that drives the head.

        Args:
            capture: The recording.
            frames: Frames that are repeated forth and back; without frames whose pose is unknown.
            sound: The sound, 16 kHz.
            name: What drives it, for messages.

        Raises:
            CaptureError: If no frame is left, or the sound is empty.
        """
        super().__init__(capture)
        frames = tuple(f for f in frames if capture.world_from_head(f) is not None)
        self.num_frames = int(len(sound.samples) / sound.rate * capture.fps)
        if not frames or not self.num_frames:
            raise CaptureError(f"{name} cannot drive {capture.path}: there is nothing to show.")
        self.path = capture.path / name
        self._frames, self._sound = [*frames, *frames[-2:0:-1]], sound

    def _frame(self, frame: int) -> int:
        """The recorded frame that is shown in a frame."""
        return self._frames[frame % len(self._frames)]

    def has_image(self, camera: int, frame: int) -> bool:
        """False: nobody recorded these words."""
        return False

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """None: nobody recorded these words."""
        return None

    def audio(self) -> Sound:
        """The sound that drives the head."""
        return self._sound

    def behind(self, camera: int, frame: int) -> np.ndarray | None:
        """What the camera sees behind the head in the frame that is shown."""
        return super().behind(camera, self._frame(frame))

    def world_from_head(self, frame: int) -> np.ndarray | None:
        """(4, 4) head pose of the frame that is shown."""
        return self.whole.world_from_head(self._frame(frame))

    def eyes(self, frame: int) -> np.ndarray | None:
        """(7,) eye and brow values of the frame that is shown."""
        return self.whole.eyes(self._frame(frame))

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """None: nobody recorded these words."""
        return None
