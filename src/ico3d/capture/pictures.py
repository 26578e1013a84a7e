"""Views of a capture for training."""

from dataclasses import dataclass

from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera


@dataclass(frozen=True)
class View:
    """A view: one frame as one camera shows it.

    Attributes:
        camera_index: Index of the camera in the capture.
        frame: Number of the frame.
        camera: The camera, in the space of the trained model.
    """

    camera_index: int
    frame: int
    camera: Camera


def train_cameras(capture: Capture) -> tuple[int, ...]:
    """Indices of the cameras that are not reserved for tests."""
    return tuple(i for i in range(len(capture.cameras)) if i not in capture.split.test_cameras)
