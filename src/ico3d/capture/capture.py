"""The interface of all recordings: what cameras and microphones recorded, read lazily."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ico3d.capture.box import Box, cut_out
from ico3d.capture.decoding import to_bytes, unit
from ico3d.capture.finding import Finding
from ico3d.capture.smplx import SmplX
from ico3d.common.camera import Camera
from ico3d.common.expression import EYE_NAMES as EYE_NAMES
from ico3d.common.people.stated import NOT_STATED
from ico3d.rig.body_track import BodyTrack, read_body_track


@dataclass(frozen=True)
class Sound:
    """Mono sound.

    Attributes:
        samples: (S,) float32 in [-1, 1]; sample 0 belongs to the time of frame 0.
        rate: Samples per second; captures return 16,000.
    """

    samples: np.ndarray
    rate: int


@dataclass(frozen=True)
class Split:
    """Which pictures are for training and which for tests (docs/architecture.md); sorted.

    Attributes:
        train: Frames for training, those for validation among them.
        test: Frames for tests; empty for bodies, which are tested with cameras.
        test_cameras: Indices of cameras that are used for tests only.
        validation_cameras: Indices of training cameras that a training which tunes settings leaves
            out, so that they can be measured in place of the test cameras.
    """

    train: tuple[int, ...]
    test: tuple[int, ...]
    test_cameras: tuple[int, ...] = ()
    validation_cameras: tuple[int, ...] = ()

    @property
    def validation(self) -> tuple[int, ...]:
        """Training frames that a training which tunes settings leaves out: the last tenth.

        Empty where cameras are for tests instead of frames.
        """
        count = len(self.train) // 10 if self.test else 0
        return self.train[len(self.train) - count :]


class Capture(ABC):
    """A recording. Pictures are read when asked for and are not cached.

    Frames are numbered 0 … num_frames − 1; frame i is at i / fps seconds. Methods return None for
    what a recording does not contain. Pictures are float32 RGB (H, W, 3) in [0, 1], masks float32
    (H, W) in [0, 1]. What trains takes them as bytes, cropped.

    Attributes:
        tells_head: Whether `head_mask` differs from `mask`.
        moves_behind: Whether `behind` differs from frame to frame.
    """

    kind: str
    shows: Literal["head", "body"] = "head"
    """What of the person the pictures show: a head (with shoulders), or the whole body."""
    path: Path
    cameras: Sequence[Camera]
    fps: float
    num_frames: int
    split: Split
    blendshape_names: tuple[str, ...] | None = None
    tells_head: bool = False
    moves_behind: bool = False

    @abstractmethod
    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The picture of a camera in a frame, or None if it was not recorded."""

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether a picture was recorded; formats say so without decoding it."""
        return self.image(camera, frame) is not None

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether there is a mask of the person; formats say so without decoding it."""
        return self.mask(camera, frame) is not None

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask (H, W) of the person in a picture: 1 inside."""
        return None

    def head_mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask (H, W) for `psnr_mask`: the person; in portraits face, hair and mouth."""
        return self.mask(camera, frame)

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of `image` in a box, uint8 (h, w, 3); the whole picture for None."""
        return _cut_bytes(self.image(camera, frame), box)

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of `mask` in a box, uint8 (h, w); the whole mask for None."""
        return _cut_bytes(self.mask(camera, frame), box)

    def head_mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of `head_mask` in a box, uint8 (h, w); the whole mask for None."""
        if not self.tells_head:
            return self.mask_bytes(camera, frame, box)
        return _cut_bytes(self.head_mask(camera, frame), box)

    def background(self, camera: int) -> np.ndarray | None:
        """The clean plate (H, W, 3): what the camera sees without the person."""
        return None

    def behind(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W, 3) what a camera sees in a frame without what `mask` shows: the clean plate."""
        return self.background(camera)

    def torso(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W, 4) colour and opacity of what a portrait shows of the person below the head."""
        return None

    def audio(self) -> Sound | None:
        """The whole sound, mono at 16 kHz."""
        return None

    def world_from_head(self, frame: int) -> np.ndarray | None:
        """Head pose W_i (4, 4): canonical head space (metres, fixed to the skull) to world."""
        return None

    def eyes(self, frame: int) -> np.ndarray | None:
        """(7,) eye and brow values of a frame, in the order of `EYE_NAMES`."""
        return None

    def blendshapes(self, frame: int) -> np.ndarray | None:
        """(len(blendshape_names),) blendshape weights of a frame."""
        return None

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) Multi-PIE landmarks in pixels of a camera, even for views without a picture."""
        return None

    def landmarks_3d(self, frame: int) -> np.ndarray | None:
        """(68, 3) Multi-PIE landmarks of a frame in canonical head space, metres."""
        return None

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) surface points of the head in a frame, in canonical head space, metres."""
        return None

    def world_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) surface points of the whole body in a frame, in the world, metres."""
        return None

    def whole_body_points(self, frame: int) -> np.ndarray | None:
        """(133, 3) annotated points of COCO-WholeBody in the world, metres; NaN where unknown."""
        return None

    def smplx(self, frame: int) -> SmplX | None:
        """SMPL-X parameters that the recording brings for a frame; None where it has none."""
        return None

    def body_track(self) -> BodyTrack | None:
        """The motion of the body that `ico3d capture pose` found; None where that has not run.

        Raises:
            CaptureError: If the track is damaged or belongs to another recording.
        """
        return read_body_track(self.path, self.num_frames, self.fps)

    def inspect(self) -> list[Finding]:
        """Missing or damaged files of this format, found without decoding them."""
        return []

    @property
    def provenance(self) -> dict:
        """Who was recorded, how, and under which licence; copied into a bundle's manifest."""
        blank = dict.fromkeys(("likeness", "consent", "licence"), NOT_STATED)
        return {"kind": self.kind, "sources": [], **blank}


class RecordedCapture(Capture):
    """A recording whose pictures and masks are stored with 8 bits per value."""

    @abstractmethod
    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of a picture in a box, uint8 (h, w, 3); the whole picture for None."""

    @abstractmethod
    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of a mask in a box, uint8 (h, w); the whole mask for None."""

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The picture (H, W, 3), or None if it was not recorded."""
        found = self.image_bytes(camera, frame)
        return None if found is None else unit(found)

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask (H, W) of the person, or None if there is none."""
        found = self.mask_bytes(camera, frame)
        return None if found is None else unit(found)


def _cut_bytes(picture: np.ndarray | None, box: Box | None) -> np.ndarray | None:
    """The part of a float32 picture in a box, as bytes."""
    return None if picture is None else to_bytes(cut_out(picture, box))


def last_eleventh(num_frames: int) -> Split:
    """The split of heads: the last 1/11 of the frames are for tests."""
    first_test = num_frames * 10 // 11
    return Split(tuple(range(first_test)), tuple(range(first_test, num_frames)))


TEST_CAMERA_EVERY = 5
VALIDATION_CAMERA_EVERY = 10
FIRST_VALIDATION_CAMERA = 4
"""Place in the ring of cameras: as far from test cameras, at places 2 and 7, as a place can be."""


def all_frames(num_frames: int, cameras: Sequence[Camera]) -> Split:
    """The split of bodies: all frames are for training, every fifth camera by azimuth for tests.

    The azimuth is measured about the upward axis y through the centre of the cameras. The first
    test camera is the third of the ring, so that a ring of three cameras already has one. Of the
    training cameras the fifth of the ring and every tenth from there are for validation.
    """
    centers = np.stack([camera.camera_to_world[:3, 3] for camera in cameras])  # (C, 3)
    across = centers - centers.mean(0)
    ring = np.argsort(np.arctan2(across[:, 0], across[:, 2]), kind="stable")
    tested = sorted(int(index) for index in ring[TEST_CAMERA_EVERY // 2 :: TEST_CAMERA_EVERY])
    tuned = sorted(int(index) for index in ring[FIRST_VALIDATION_CAMERA::VALIDATION_CAMERA_EVERY])
    tests = tuple(tested) if len(cameras) > 2 else ()
    return Split(tuple(range(num_frames)), (), tests, tuple(tuned))
