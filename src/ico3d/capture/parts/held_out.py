"""A capture without the pictures that are kept for tests: whatever trains sees nothing else."""

from collections.abc import Collection
from dataclasses import replace
from typing import Literal

import numpy as np

from ico3d.capture.box import Box
from ico3d.capture.capture import Capture, Split
from ico3d.capture.parts.wrapped import WrappedCapture
from ico3d.errors import CaptureError


class PartOfCapture(WrappedCapture):
    """Some pictures of a capture, with their masks and landmarks; the others seem not recorded.

    Cameras keep their numbers, frames too; what belongs to no picture, such as head poses and
    sound, is that of the capture.
    """

    def __init__(self, capture: Capture, cameras: Collection[int], frames: Collection[int]):
        """Takes the capture, and cameras and frames whose pictures can be seen."""
        super().__init__(capture)
        self._seen = frozenset(cameras), frozenset(frames)

    def _shows(self, camera: int, frame: int) -> bool:
        return camera in self._seen[0] and frame in self._seen[1]

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether there is a picture that can be seen."""
        return self._shows(camera, frame) and self.whole.has_image(camera, frame)

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether there is a mask that can be seen."""
        return self._shows(camera, frame) and self.whole.has_mask(camera, frame)

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The recorded picture; None where it cannot be seen."""
        return self.whole.image(camera, frame) if self._shows(camera, frame) else None

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask of the person; None where it cannot be seen."""
        return self.whole.mask(camera, frame) if self._shows(camera, frame) else None

    def head_mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask for `psnr_mask`; None where it cannot be seen."""
        return self.whole.head_mask(camera, frame) if self._shows(camera, frame) else None

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the picture in a box, uint8; None where the picture cannot be seen."""
        return self.whole.image_bytes(camera, frame, box) if self._shows(camera, frame) else None

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the mask in a box, uint8; None where the picture cannot be seen."""
        return self.whole.mask_bytes(camera, frame, box) if self._shows(camera, frame) else None

    def head_mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the mask for `psnr_mask`, uint8; None where it cannot be seen."""
        return (
            self.whole.head_mask_bytes(camera, frame, box) if self._shows(camera, frame) else None
        )

    def behind(self, camera: int, frame: int) -> np.ndarray | None:
        """What the camera sees in a frame without what the mask shows; None where it is hidden."""
        return super().behind(camera, frame) if self._shows(camera, frame) else None

    def torso(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W, 4) what a portrait shows below the head; None where it cannot be seen."""
        return self.whole.torso(camera, frame) if self._shows(camera, frame) else None

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) landmarks in pixels; None where the picture cannot be seen."""
        return self.whole.landmarks(camera, frame) if self._shows(camera, frame) else None


def training_split(split: Split, hold_out: bool) -> Split:
    """The split of a training.

    Args:
        split: The capture's split.
        hold_out: Whether the validation pictures are kept out of the training, too.
    """
    if not hold_out:
        return split
    cameras = tuple(sorted({*split.test_cameras, *split.validation_cameras}))
    frames = tuple(frame for frame in split.train if frame not in split.validation)
    return replace(split, train=frames, test_cameras=cameras)


def training_part(capture: Capture, hold_out: bool) -> Capture:
    """What of a capture may train: without its test pictures.

    Args:
        capture: The recording.
        hold_out: Whether the validation pictures are kept out, too, so that they can be measured
            while settings are tuned.

    Raises:
        CaptureError: If validation pictures are to be kept out and the capture has none.
    """
    split = training_split(capture.split, hold_out)
    if hold_out:
        validation_pictures(capture)
    cameras = set(range(len(capture.cameras))) - set(split.test_cameras)
    part = PartOfCapture(capture, cameras, split.train)
    part.split = split
    return part


def scored_pictures(
    capture: Capture, which: Literal["test", "validation", "all"]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Cameras and frames of the pictures by which a model of a capture is measured.

    Args:
        capture: The recording.
        which: `test` for its test pictures, `validation` for those for tuning, `all` for all.

    Raises:
        CaptureError: If the capture has no such pictures.
    """
    cameras, frames = range(len(capture.cameras)), range(capture.num_frames)
    if which == "all":
        return tuple(cameras), tuple(frames)
    if which == "validation":
        return validation_pictures(capture)
    if capture.split.test:
        return tuple(cameras), capture.split.test
    if not capture.split.test_cameras:
        raise CaptureError(
            f"{capture.path} has no test cameras (of fewer than 3, all train): "
            "measure with all by --frames all."
        )
    return capture.split.test_cameras, tuple(frames)


def validation_pictures(capture: Capture) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Cameras and frames of the validation pictures.

    Raises:
        CaptureError: If the capture has too few cameras or frames to have any.
    """
    split = capture.split
    if split.validation:
        return tuple(range(len(capture.cameras))), split.validation
    if not split.validation_cameras:
        raise CaptureError(
            f"{capture.path} has no validation pictures: a body needs 5 cameras, a head 10 "
            "training frames."
        )
    return split.validation_cameras, tuple(range(capture.num_frames))
