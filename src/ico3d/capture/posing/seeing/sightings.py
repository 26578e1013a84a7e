"""What a capture's cameras see of a person: points and outlines, read picture by picture."""

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
"""Cameras that are looked at; more add work, and hardly anything to a pose."""
MARGIN = 1.25
"""Side of the part that the body model is shown, by the person's height or width."""
HAND_SHOWN = 0.30
"""Metres that the part around a hand shows."""
HAND_OFF = 0.08
"""Metres by which a hand's wrist may miss the arm's: else it is another hand."""
COARSE_HAND = 0.25
"""Weight of the points of a hand that the body model sees."""
NUMBER = {name: number for number, name in enumerate(LANDMARKS)}
POSE = np.array([NUMBER[name] for name in MEDIAPIPE_POSE])
COARSE = np.array([name.startswith(("little", "index", "thumb")) for name in MEDIAPIPE_POSE])


@dataclass(eq=False)
class Seen:
    """What C cameras see of P landmarks in F frames.

    Attributes:
        capture: The recording.
        chosen: C numbers of cameras.
        pixels: (F, C, P, 2) float32 pixels; 0 where a point is not seen.
        weights: (F, C, P) float32 in [0, 1]; 0 where a point is not seen.
        relative: (F, C, 33, 3) float32 metres about the hips, in axes of the world.
        outlines: Of the person.
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
        """C cameras."""
        return [self.capture.cameras[camera] for camera in self.chosen]


class Watcher:
    """Reads the pictures of a capture with MediaPipe, several at a time."""

    def __init__(self, capture: Capture, readers: list[BodyReader], workers: int):
        """Chooses among the cameras that train; without readers, only outlines can be read."""
        able = [c for c in range(len(capture.cameras)) if c not in capture.split.test_cameras]
        self.seen = Seen(capture, [able[i] for i in spread(len(able), MOST_CAMERAS)])
        self._readers: queue.SimpleQueue[BodyReader] = queue.SimpleQueue()
        for reader in readers:
            self._readers.put(reader)
        self._workers = workers

    def look(self, bodies: bool) -> None:
        """Takes down outlines, and what the body model sees if `bodies`."""

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
        """Takes down what the hand model sees around hands.

        Args:
            points: (F, P, 3) metres where landmarks are about; NaN where nobody knows.
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
        """Takes down the body in a picture; 1 if there is one."""
        part = person_part(image.shape[:2], mask)
        if part is None:
            return 0
        with self._reader() as reader:
            body = reader.body(part.cut(image))
        if body is None:
            return 0
        camera = self.seen.cameras[place]
        self.seen.pixels[frame, place, POSE] = part.whole(body.pixels)
        self.seen.weights[frame, place, POSE] = body.visibility * np.where(COARSE, COARSE_HAND, 1)
        self.seen.relative[frame, place] = body.relative @ camera.world_to_camera[:3, :3]
        return 1

    def _hand(
        self, frame: int, place: int, image: np.ndarray, points: np.ndarray, side: str
    ) -> int:
        """Takes down a hand in a picture; 1 if there is one."""
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
        # The wrist stays the arm's: the hand's own lies deeper in the hand.
        self.seen.pixels[frame, place, numbers[1:]] = pixels[1:]
        self.seen.weights[frame, place, numbers[1:]] = max(sure, 0.1)
        return 1


def person_part(size: tuple[int, int], mask: np.ndarray | None) -> Part | None:
    """The square part of a picture (H, W) that holds the person; None where the mask is empty."""
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
    """A watcher whose models are closed in the end.

    Raises:
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If a model file is not there.
        CaptureError: If one cannot be used.
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
