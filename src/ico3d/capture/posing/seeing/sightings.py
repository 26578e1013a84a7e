"""Reads a person's points and outlines in all pictures of a capture."""

import queue
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.headtrack.crops import Part, around
from ico3d.capture.multiview.parallel import View, each_camera
from ico3d.capture.posing.model.landmarks import LANDMARKS
from ico3d.capture.posing.model.naming import MEDIAPIPE_POSE, hand
from ico3d.capture.posing.seeing.mediapipe_body import PURPOSE, BodyReader
from ico3d.capture.posing.seeing.outlines import Outlines
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.common.weights import model_file

MOST_CAMERAS = 16
"""Most cameras whose pictures are read; more would hardly improve poses."""
MARGIN = 1.25
"""Side of the square that the body model sees, relative to the person's larger extent."""
HAND_SHOWN = 0.30
"""Side in metres of the square around a hand that the hand model sees."""
HAND_OFF = 0.08
"""Largest distance in metres between the wrists of a hand and of its arm; else the hand is another.
"""
GUESSED = 1e-4
"""Factor of the weights of points beyond the picture's border, where the body model only guesses.

A camera still takes part with its other points, and these do not count as seen by it
(`agreement.LEAST_WEIGHT`). A single camera's guesses keep their weights: nothing else is known.
"""
COARSE_HAND = 0.25
"""Factor of the weights of hand points that the body model finds."""
NUMBER = {name: number for number, name in enumerate(LANDMARKS)}
"""Index of each landmark."""
POSE = np.array([NUMBER[name] for name in MEDIAPIPE_POSE])
"""(33,) index of the landmark of each point of MediaPipe's body model."""
COARSE = np.array([name.startswith(("little", "index", "thumb")) for name in MEDIAPIPE_POSE])
"""(33,) bool: points of hands in MediaPipe's body model."""


@dataclass(eq=False)
class Seen:
    """P landmarks and outlines of a person, as C cameras see them in F frames.

    Attributes:
        capture: The recording.
        chosen: Indices of the C cameras in the recording.
        pixels: (F, C, P, 2) float32 pixels of the landmarks; 0 where one is not seen.
        weights: (F, C, P) float32 weights in [0, 1]; 0 where a landmark is not seen.
        relative: (F, C, 33, 3) float32 points of MediaPipe's body model relative to the middle of
            the hips, in axes of the world, metres.
        outlines: Outlines of the person.
    """

    capture: Capture
    chosen: list[int]
    pixels: np.ndarray = field(init=False)
    weights: np.ndarray = field(init=False)
    relative: np.ndarray = field(init=False)
    outlines: Outlines = field(init=False)

    def __post_init__(self):
        frames, cameras = self.capture.num_frames, len(self.chosen)
        self.pixels = np.zeros((frames, cameras, len(LANDMARKS), 2), np.float32)
        self.weights = np.zeros((frames, cameras, len(LANDMARKS)), np.float32)
        self.relative = np.zeros((frames, cameras, len(POSE), 3), np.float32)
        self.outlines = Outlines.empty(frames, self.cameras)

    @property
    def cameras(self) -> list[Camera]:
        """The C cameras."""
        return [self.capture.cameras[camera] for camera in self.chosen]


class Watcher:
    """Reads the pictures of a capture with MediaPipe, in several threads.

    Attributes:
        seen: What was read so far.
    """

    def __init__(self, capture: Capture, readers: list[BodyReader], workers: int):
        """Chooses up to `MOST_CAMERAS` cameras that are not test cameras.

        Args:
            capture: The recording.
            readers: MediaPipe's models, one for each thread; without any, only outlines can be
                read.
            workers: Number of threads.
        """
        able = [c for c in range(len(capture.cameras)) if c not in capture.split.test_cameras]
        self.seen = Seen(capture, [able[i] for i in spread(len(able), MOST_CAMERAS)])
        self._readers: queue.SimpleQueue[BodyReader] = queue.SimpleQueue()
        for reader in readers:
            self._readers.put(reader)
        self._workers = workers

    def look(self, bodies: bool) -> None:
        """Reads outlines, and points of the body as well if `bodies`."""

        def start(place: int) -> View:
            camera, capture = self.seen.chosen[place], open_capture(self.seen.capture.path)

            def view(frame: int) -> int:
                mask = capture.mask(camera, frame)
                if mask is not None:
                    self.seen.outlines.add(frame, place, mask)
                image = capture.image(camera, frame) if bodies else None
                return 0 if image is None else self._body(frame, place, image, mask)

            return view

        each_camera(
            start,
            range(len(self.seen.chosen)),
            self._frames,
            self._workers,
            "looking for the person",
        )

    def look_at_hands(self, points: np.ndarray) -> None:
        """Reads points of hands.

        Args:
            points: (F, P, 3) approximate positions of the landmarks in the world, metres, which say
                where hands are; NaN where unknown.
        """

        def start(place: int) -> View:
            camera, capture = self.seen.chosen[place], open_capture(self.seen.capture.path)

            def view(frame: int) -> int:
                if not np.isfinite(points[frame]).any():
                    return 0
                image = capture.image(camera, frame)
                if image is None:
                    return 0
                return sum(
                    self._hand(frame, place, image, points[frame], side) for side in ("L", "R")
                )

            return view

        each_camera(
            start, range(len(self.seen.chosen)), self._frames, self._workers, "looking at hands"
        )

    @property
    def _frames(self) -> int:
        return self.seen.capture.num_frames

    @contextmanager
    def _reader(self) -> Iterator[BodyReader]:
        reader = self._readers.get()
        try:
            yield reader
        finally:
            self._readers.put(reader)

    def _body(self, frame: int, place: int, image: np.ndarray, mask: np.ndarray | None) -> int:
        """Reads the body in a picture; returns 1 if there is one, else 0."""
        part = person_part(image.shape[:2], mask)
        if part is None:
            return 0
        with self._reader() as reader:
            body = reader.body(part.cut(image))
        if body is None:
            return 0
        camera, pixels = self.seen.cameras[place], part.whole(body.pixels)
        sure = body.visibility * np.where(COARSE, COARSE_HAND, 1)  # (33,)
        if len(self.seen.cameras) > 1:
            shown = ((pixels >= 0) & (pixels <= (camera.width, camera.height))).all(1)  # (33,)
            sure = sure * np.where(shown, 1, GUESSED)
        self.seen.pixels[frame, place, POSE] = pixels
        self.seen.weights[frame, place, POSE] = sure
        self.seen.relative[frame, place] = body.relative @ camera.world_to_camera[:3, :3]
        return 1

    def _hand(
        self, frame: int, place: int, image: np.ndarray, points: np.ndarray, side: str
    ) -> int:
        """Reads the hand of a side in a picture; returns 1 if there is one, else 0."""
        numbers = np.array([NUMBER[name] for name in hand(side)])
        wrist, knuckles = points[numbers[0]], points[numbers[[5, 17]]].mean(0)
        center = wrist + 1.1 * (knuckles - wrist)
        camera = self.seen.cameras[place]
        part = around(camera, center, HAND_SHOWN) if np.isfinite(center).all() else None
        if part is None:
            return 0
        with self._reader() as reader:
            found = reader.hand(part.cut(image))
        if found is None:
            return 0
        pixels = part.whole(found.pixels)
        off = np.linalg.norm(pixels[0] - camera.project(wrist)[0]) * HAND_SHOWN / part.side
        if off > HAND_OFF:
            return 0
        sure = found.score if found.left == (side == "L") else 1 - found.score
        # The wrist of the body model is kept: that of the hand model lies deeper in the hand.
        self.seen.pixels[frame, place, numbers[1:]] = pixels[1:]
        self.seen.weights[frame, place, numbers[1:]] = max(sure, 0.1)
        return 1


def person_part(size: tuple[int, int], mask: np.ndarray | None) -> Part | None:
    """The square part of a picture that holds the person; None where the mask shows nobody.

    Args:
        size: Height and width of the picture in pixels.
        mask: (H, W) mask of the person; None takes the whole picture.
    """
    rows, columns = np.arange(size[0]), np.arange(size[1])
    if mask is not None:
        person = mask > 0.5
        rows, columns = np.flatnonzero(person.any(1)), np.flatnonzero(person.any(0))
        if not len(rows):
            return None
    middle = (columns[0] + columns[-1] + 1) / 2, (rows[0] + rows[-1] + 1) / 2
    side = round(max(len(rows), np.ptp(rows) + 1, np.ptp(columns) + 1) * MARGIN)
    return Part(round(middle[0] - side / 2), round(middle[1] - side / 2), side)


@contextmanager
def watcher(capture: Capture, workers: int) -> Iterator[Watcher]:
    """A context with a watcher, whose models are closed in the end.

    Args:
        capture: The recording.
        workers: Number of threads, each with its own models.

    Raises:
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If a model file is missing.
        CaptureError: If a model file cannot be used.
    """
    models = [model_file(f"{name}_landmarker.task", PURPOSE) for name in ("pose", "hand")]
    readers: list[BodyReader] = []
    try:
        for _ in range(workers):
            readers.append(BodyReader(*models))
        yield Watcher(capture, readers, workers)
    finally:
        for reader in readers:
            reader.close()
