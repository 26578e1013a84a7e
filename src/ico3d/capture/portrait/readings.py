"""Reads the face in every picture of a video."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from rich.console import Console

from ico3d.capture.face.landmarks import MULTI_PIE
from ico3d.capture.face.mediapipe_face import FaceReader
from ico3d.capture.portrait.files import save_landmarks, save_picture
from ico3d.capture.portrait.settings import FACES, FPS
from ico3d.capture.progress import Reached, tracked
from ico3d.capture.video import Video
from ico3d.common.spread import spread
from ico3d.errors import CaptureError

BLOCK, SAME = 8, 3.0
"""Side of the parts of a picture that are compared, in every other of its pixels, and the mean
difference, of 255, below which they are the same but for hasty compression."""
MOST_REPEATED = 2
"""Number of pictures in a row that are taken for repeated: who sits still for longer is seen."""


@dataclass
class Readings:
    """What MediaPipe's face model finds in a clip.

    Attributes:
        landmarks: (478, 2) pixels for each frame with a face.
        blendshapes: (52,) weights for each frame with a face.
        poses: (4, 4) rough head pose for each frame with a face, see `Face.pose`.
        frames: Numbers of the frames with a face.
        missing: Numbers of the frames without a face.
        repeated: Numbers of the frames that show a picture of another moment, and are not read.
        names: Names of the blendshapes.
        total: Number of all frames of the clip.
    """

    landmarks: list[np.ndarray] = field(default_factory=list)
    blendshapes: list[np.ndarray] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    missing: list[int] = field(default_factory=list)
    repeated: list[int] = field(default_factory=list)
    names: tuple[str, ...] = ()
    total: int = 0

    def part(self, chosen: list[int]) -> "Readings":
        """Those of some frames with a face, given by their places in `frames`."""
        lists = {"landmarks", "blendshapes", "poses", "frames"}
        return replace(self, **{name: [getattr(self, name)[i] for i in chosen] for name in lists})


def read_faces(
    work: Path, video: Video, model: Path, console: Console, reached: Reached | None
) -> Readings:
    """Reads the face in every picture, and writes those that show one.

    A moment of which the video has no picture of its own, because the camera was slow or the
    picture before was recorded again, is left out: face and sound would not belong together.

    Raises:
        CaptureError: If there is no face in any of them.
        StorageError: If the disk is nearly full.
    """
    readings = Readings()
    total = round(video.announced / video.rate * FPS) if video.announced * video.rate else None
    with FaceReader(model) as reader:
        frames = tracked(video.sampled(FPS), FACES, total, console, reached)
        before, in_a_row = None, 0
        for number, (image, own) in enumerate(frames):
            readings.total = number + 1
            again = own and before is not None and is_repeated(image, before)
            if not own or (again and in_a_row < MOST_REPEATED):
                in_a_row += again
                readings.repeated.append(number)
                continue
            in_a_row = 0
            face = reader.read(image)
            if face is None:
                readings.missing.append(number)
                continue
            before = image
            save_picture(work / "ori_imgs" / f"{number}.jpg", image)
            readings.frames.append(number)
            readings.landmarks.append(face.landmarks)
            readings.blendshapes.append(face.blendshapes)
            readings.poses.append(face.pose)
            save_landmarks(work / "ori_imgs" / f"{number}.lms", face.landmarks[MULTI_PIE])
        readings.names = reader.names
    if not readings.frames:
        raise CaptureError.of("faceless", f"{video.path}: ", values={"n": readings.total})
    return readings


def is_repeated(image: np.ndarray, before: np.ndarray) -> bool:
    """Whether a picture (H, W, 3) uint8 is the one before once more, but for its compression.

    A single part of `BLOCK` pixels in which something moved tells that it is not.
    """
    height, width = (BLOCK * (side // 2 // BLOCK) for side in image.shape[:2])
    pair = [picture[::2, ::2][:height, :width].astype(np.int16) for picture in (image, before)]
    away = np.abs(pair[0] - pair[1]).mean(-1)  # (h, w)
    parts = away.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK).mean((1, 3))
    return bool(parts.max(initial=0) < SAME)


def save_blendshapes(work: Path, readings: Readings) -> None:
    """`bs.npy`, a row per frame; frames without a face get what lies between their neighbours."""
    values = np.stack(readings.blendshapes)
    every = np.arange(readings.total)
    rows = [np.interp(every, readings.frames, column) for column in values.T]
    np.save(work / "bs.npy", np.stack(rows, 1).astype(np.float32))


def thinned(work: Path, readings: Readings, most: int | None) -> tuple[Readings, list[int]]:
    """At most so many frames with a face, evenly spread; the pictures of the others are removed.

    Returns:
        Their readings, and their places among all frames with a face.
    """
    found = len(readings.frames)
    chosen = list(range(found)) if most is None else spread(found, most)
    for place in sorted(set(range(found)) - set(chosen)):
        for suffix in (".jpg", ".lms"):
            (work / "ori_imgs" / f"{readings.frames[place]}{suffix}").unlink()
    return readings.part(chosen), chosen
