"""Finds the faces of a picture for SyncNet: by S3FD as published, or else by MediaPipe."""

import logging
from contextlib import AbstractContextManager
from typing import Protocol

import numpy as np
import torch

from ico3d.errors import MissingExtraError, MissingModelError
from ico3d.measure.sync.s3fd import faces_of, load_s3fd
from ico3d.measure.sync.tracks import resized

SCALE = 4
"""Factor by which pictures are smaller when S3FD looks at them."""

log = logging.getLogger(__name__)


class Detector(AbstractContextManager["Detector"], Protocol):
    """Finds faces.

    Attributes:
        name: What the detector is called in results.
    """

    name: str

    def boxes(self, picture: np.ndarray) -> np.ndarray:
        """Boxes (F, 4) left, top, right, bottom of the faces in a picture uint8 RGB (H, W, 3)."""
        ...


class S3fdDetector:
    """Finds faces by S3FD in pictures of a quarter of the size."""

    name = "s3fd"

    def __init__(self, device: torch.device):
        """Loads the network.

        Raises:
            MissingModelError: If its weights are not installed.
            ModelError: If the file does not hold them.
        """
        self._network, self._device = load_s3fd().to(device), device

    def __enter__(self) -> "S3fdDetector":
        return self

    def __exit__(self, *details) -> None:
        pass

    @torch.no_grad()
    def boxes(self, picture: np.ndarray) -> np.ndarray:
        """Boxes (F, 4) of the faces, the most confident first."""
        height, width = picture.shape[:2]
        small = reduced(picture)
        found = faces_of(self._network(torch.from_numpy(small).to(self._device).float()))  # (F, 5)
        across, down = width / small.shape[1], height / small.shape[0]
        return found[:, :4].cpu().numpy().astype(np.float64) * (across, down, across, down)


def reduced(picture: np.ndarray) -> np.ndarray:
    """A picture (H, W, 3) at a quarter of the size; sides are rounded to whole pixels."""
    height, width = (max(round(side / SCALE), 1) for side in picture.shape[:2])
    missing = [(0, max(small * SCALE - side, 0)) for small, side in
               zip((height, width), picture.shape[:2], strict=True)]  # fmt: skip
    whole = np.pad(picture, (*missing, (0, 0)), mode="edge")
    return resized(whole[: height * SCALE, : width * SCALE], height, width)


class MediapipeDetector:
    """Finds one face by MediaPipe; its box is that of the 468 points of the face's surface.

    The points reach from the hairline to the chin and from ear to ear, as S3FD's boxes do, whose
    training data was annotated so.
    """

    name = "mediapipe"

    def __init__(self):
        """Loads MediaPipe.

        Raises:
            MissingExtraError: If MediaPipe is not installed.
            MissingModelError: If its model is not installed.
        """
        from ico3d.capture.face.mediapipe_face import FaceReader
        from ico3d.common.weights import model_file

        self._reader = FaceReader(model_file("face_landmarker.task", "finding faces"))

    def __enter__(self) -> "MediapipeDetector":
        return self

    def __exit__(self, *details) -> None:
        self._reader.__exit__(*details)

    def boxes(self, picture: np.ndarray) -> np.ndarray:
        """Box (1, 4) of the face; (0, 4) without one."""
        from ico3d.capture.face.mediapipe_face import MESH_LANDMARKS

        face = self._reader.read(picture)
        if face is None:
            return np.zeros((0, 4))
        points = face.landmarks[:MESH_LANDMARKS]
        return np.concatenate([points.min(0), points.max(0)])[None]  # (1, 4)


def detector_on(device: torch.device) -> Detector:
    """S3FD on a device if its weights are installed, else MediaPipe with a warning.

    Raises:
        MissingModelError: If S3FD's weights are absent, and MediaPipe or its model, too.
    """
    try:
        return S3fdDetector(device)
    except MissingModelError as error:
        try:
            detector = MediapipeDetector()
        except (MissingExtraError, MissingModelError):
            raise error from None
        log.warning("faces are found by MediaPipe, not as published by S3FD: %s", error)
        return detector
