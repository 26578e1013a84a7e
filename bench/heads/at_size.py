"""How near a head's pictures are to its recording, both at another size.

    python bench/heads/at_size.py HEAD CAPTURE --size 512 [--seen]

Metrics are those of `ico3d evaluate`, on the same unseen frames. Recorded pictures, masks and
landmarks are scaled down by areas; the head is drawn by cameras of that size.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import tyro
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.parts.held_out import PartOfCapture, scored_pictures
from ico3d.capture.parts.trained_on import check_untrained
from ico3d.capture.parts.wrapped import WrappedCapture
from ico3d.cli import run_script
from ico3d.errors import ModelError
from ico3d.head.expressions import ExpressionTrack
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.head.train_head import displacement_of, seen_moves
from ico3d.measure.head import evaluate_head
from ico3d.splat.gaussians import Gaussians


class Smaller(WrappedCapture):
    """A capture of a head with pictures of another height."""

    image_bytes = Capture.image_bytes
    mask_bytes = Capture.mask_bytes
    head_mask_bytes = Capture.head_mask_bytes

    def __init__(self, capture: Capture, height: int):
        """Scales all cameras to a height in pixels."""
        super().__init__(capture)
        self.cameras = tuple(
            camera.resized(round(height * camera.width / camera.height), height)
            for camera in capture.cameras
        )

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The recorded picture, smaller."""
        return self._small(camera, self.whole.image(camera, frame))

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask, smaller."""
        return self._small(camera, self.whole.mask(camera, frame))

    def head_mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask for `psnr_mask`, smaller."""
        return self._small(camera, self.whole.head_mask(camera, frame))

    def background(self, camera: int) -> np.ndarray | None:
        """The clean plate, smaller."""
        return self._small(camera, self.whole.background(camera))

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) landmarks in smaller pixels."""
        found, large = self.whole.landmarks(camera, frame), self.whole.cameras[camera]
        small = self.cameras[camera]
        size = small.width / large.width, small.height / large.height
        return None if found is None else (found * size).astype(found.dtype)

    def _small(self, camera: int, picture: np.ndarray | None) -> np.ndarray | None:
        if picture is None:
            return None
        size = self.cameras[camera].width, self.cameras[camera].height
        return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


class SeenTrack:
    """A track that remembers which frame was asked for last."""

    def __init__(self, track: ExpressionTrack):
        """Begins before the first frame."""
        self.track, self.size, self.frame = track, track.size, -1

    def at(self, frame: int) -> Tensor:
        """The expression (B,) of a frame."""
        self.frame = frame
        return self.track.at(frame)


class SeenModel:
    """A head model whose skin is where landmarks were seen in the frame that was asked for last."""

    def __init__(self, model: HeadModel, moves: Mapping[int, Tensor], track: SeenTrack):
        """Takes the coefficients (M,) of the displacements by frame."""
        self._model, self._moves, self._track = model, moves, track
        self.shape, self.device = model.shape, model.device

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self._model)

    def __call__(self, expression: Tensor) -> Gaussians:
        """The Gaussians for an expression (B,)."""
        return self._model(expression, moves=self._moves[self._track.frame])


@dataclass
class SeenHead(TrainedHead):
    """A head whose skin is where landmarks were seen."""

    def track(self, capture: Capture) -> ExpressionTrack:
        """The expressions of a capture; from now on frames have the skin of that capture.

        Raises:
            ModelError: If the head's Gaussians stand still, or the capture tells no landmarks.
        """
        track = SeenTrack(super().track(capture))
        found = displacement_of(capture, self.model.shape.displacements)
        if found is None:
            raise ModelError("the head's Gaussians stand still, or no landmarks were recorded.")
        moves = seen_moves(found, capture, range(capture.num_frames))
        self.model = SeenModel(self.model, moves, track)  # type: ignore[assignment]
        return track


@dataclass(frozen=True)
class Bench:
    """What to measure.

    Attributes:
        head: Folder of a trained head.
        capture: Its recording.
        size: Height of the pictures in pixels.
        seen: Skin is where landmarks were seen, instead of where the expression tells it to be.
    """

    head: tyro.conf.Positional[Path]
    capture: tyro.conf.Positional[Path]
    size: int = 512
    seen: bool = False

    def run(self) -> None:
        """Prints the metrics."""
        head, capture = TrainedHead.load(self.head), open_capture(self.capture)
        cameras, frames = scored_pictures(capture, "test")
        check_untrained(head.records, capture, cameras, frames)
        if self.seen:
            head = SeenHead(**vars(head))
        part = PartOfCapture(Smaller(capture, self.size), cameras, frames)
        for name, value in evaluate_head(head, part, frames, None).items():
            if isinstance(value, float):
                print(f"{name:16} {value:.5g}")


if __name__ == "__main__":
    sys.exit(run_script(Bench))
