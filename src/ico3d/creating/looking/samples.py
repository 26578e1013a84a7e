"""Looks at a few pictures per second of a video."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.face.mediapipe_face import Face, FaceReader
from ico3d.capture.posing.seeing.mediapipe_body import HandReader
from ico3d.capture.video import Video
from ico3d.common.weights import find_model, model_file

RATE = 4.0
"""Pictures per second that are looked at."""
MOST = 400
"""Number of pictures that are looked at; of longer videos fewer per second."""
JAW_OPEN = BLENDSHAPES.index("jawOpen")
SURE = 0.6
"""Least confidence of a hand: with less, a face alone passes for one now and then."""
FACE_SIDE = 160
"""Side in pixels to which faces are scaled before their sharpness is measured."""
CORNER = (0.2, 0.12)
"""Height and width of a picture's upper corners, by which the camera is seen to move."""


@dataclass(frozen=True)
class Sample:
    """What is seen in a picture; what is about a face is that of the largest one.

    Attributes:
        second: When it was taken, seconds after the first picture.
        faces: Number of faces, two at most.
        light: Mean brightness of the face, or of the picture where there is none, 0 to 1.
        burnt: Share of the face's pixels that are white, 0 to 1.
        sharpness: How much neighbouring pixels of the face differ, relative to its contrast.
        width: Width of the face in pixels.
        inside: Whether all of the face is in the picture.
        hands: Whether a hand is before the face.
        turn: (2,) degrees by which the face looks to its left, and up.
        jaw: How far the jaw is open, 0 to 1.
        corners: (2, 8, 8) brightness of the picture's upper corners, 0 to 1.
    """

    second: float
    faces: int
    light: float
    burnt: float
    sharpness: float
    width: float
    inside: bool
    hands: bool
    turn: tuple[float, float]
    jaw: float
    corners: np.ndarray


@dataclass(frozen=True)
class Samples:
    """What is seen in a video.

    Attributes:
        all: The pictures that were looked at, in their order.
        apart: Seconds from one to the next.
        size: Short side of the pictures in pixels.
        hands_sought: Whether hands were looked for.
    """

    all: tuple[Sample, ...]
    apart: float
    size: int
    hands_sought: bool

    @property
    def with_face(self) -> tuple[Sample, ...]:
        """Those that show a face."""
        return tuple(sample for sample in self.all if sample.faces)


def sampled(video: Video, reached: Callable[[float], None]) -> Samples:
    """Looks at pictures of a video, evenly spread.

    Args:
        video: The video; it is read to its end.
        reached: Told which share of them was looked at.

    Raises:
        CaptureError: If no picture can be decoded, or a model file cannot be used.
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If the face model is not installed.
    """
    rate = RATE
    seconds = video.announced / video.rate if video.announced * video.rate else 0.0
    if seconds * rate > MOST:
        rate = MOST / seconds
    found = []
    with _readers() as (faces, hands):
        for number, picture in enumerate(video.frames(rate)):
            found.append(sample_of(number / rate, picture, faces, hands))
            if seconds:
                reached(min((number + 1) / (seconds * rate), 1.0))
    return Samples(tuple(found), 1 / rate, min(video.width, video.height), hands is not None)


@contextmanager
def _readers() -> Iterator[tuple[FaceReader, HandReader | None]]:
    """MediaPipe's finders of faces, and of hands where their model is installed."""
    model: Path = model_file("face_landmarker.task", "tracking a portrait")
    of_hands = find_model("hand_landmarker.task")
    hands = None if of_hands is None else HandReader(of_hands, 2, SURE)
    try:
        with FaceReader(model, 2) as faces:
            yield faces, hands
    finally:
        if hands is not None:
            hands.close()


def sample_of(
    second: float, picture: np.ndarray, faces: FaceReader, hands: HandReader | None
) -> Sample:
    """What one picture, uint8 RGB (H, W, 3), shows."""
    found = sorted(faces.faces(picture), key=_width, reverse=True)
    grey = picture.mean(-1).astype(np.float32) / 255  # (H, W)
    if not found:
        light = float(grey.mean())
        nothing = (second, 0, light, 0.0, 0.0, 0.0, False, False, (0.0, 0.0), 0.0)
        return Sample(*nothing, _corners(grey))
    face = found[0]
    low, high = face.landmarks.min(0), face.landmarks.max(0)  # (2,)
    seen_hands = [] if hands is None else hands.hands(picture)
    crop = _cut(grey, low, high)
    return Sample(
        second=second,
        faces=len(found),
        light=float(crop.mean()),
        burnt=float((crop > 0.98).mean()),
        sharpness=sharpness_of(crop),
        width=_width(face),
        inside=bool((low >= 0).all() and high[0] <= grey.shape[1] and high[1] <= grey.shape[0]),
        hands=any(_before(hand.pixels, face) for hand in seen_hands),
        turn=_turn(face.pose[:3, :3]),
        jaw=float(face.blendshapes[JAW_OPEN]),
        corners=_corners(grey),
    )


def _width(face: Face) -> float:
    """Width of a face in pixels."""
    return float(np.ptp(face.landmarks[:, 0]))


def _cut(grey: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The middle of the face's box, without what is beside a round face; one pixel at least."""
    inner = 0.15 * (high - low)
    size = np.array(grey.shape[::-1])
    x0, y0 = np.clip((low + inner).astype(int), 0, size - 1)
    x1, y1 = np.clip((high - inner).astype(int), [x0 + 1, y0 + 1], size)
    return grey[y0:y1, x0:x1]


def sharpness_of(crop: np.ndarray) -> float:
    """Root mean square of the Laplacian of a face (h, w), relative to its contrast."""
    import cv2

    scaled = cv2.resize(crop, (FACE_SIDE, FACE_SIDE), interpolation=cv2.INTER_AREA)
    edges = cv2.Laplacian(scaled, cv2.CV_32F)
    return float(edges.std() / max(float(scaled.std()), 1e-3))


def _before(hand: np.ndarray, face: Face) -> bool:
    """Whether points (21, 2) of a hand lie on the face."""
    import cv2

    outline = cv2.convexHull(face.landmarks.astype(np.float32))
    return any(cv2.pointPolygonTest(outline, tuple(map(float, p)), False) >= 0 for p in hand)


def _turn(rotation: np.ndarray) -> tuple[float, float]:
    """Degrees by which a face (3, 3), as MediaPipe poses it, looks to its left, and up."""
    x, y, z = rotation[:, 2]
    return float(np.degrees(np.arctan2(x, z))), float(np.degrees(np.arcsin(np.clip(y, -1, 1))))


def _corners(grey: np.ndarray) -> np.ndarray:
    """(2, 8, 8) the upper corners of a picture (H, W), small."""
    import cv2

    width, height = (
        max(8, round(s * side)) for s, side in zip(CORNER, grey.shape[::-1], strict=True)
    )
    parts = (grey[:height, :width], grey[:height, -width:])
    return np.stack([cv2.resize(part, (8, 8), interpolation=cv2.INTER_AREA) for part in parts])
