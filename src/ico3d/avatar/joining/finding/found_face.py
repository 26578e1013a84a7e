"""Finds the face of a head model and that of a recorded person with the same tracker.

MediaPipe places the corner of an eye a little differently than the landmarks of a data set or a
face model do. So if a head's face has to be found by MediaPipe, the body's face is found by it,
too: the tracker's errors are then in both and cancel.
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ico3d.avatar.joining.finding.drawn_head import DrawnHead
from ico3d.avatar.joining.finding.first_look import LEAST_HELD, first_looks
from ico3d.avatar.joining.similarity import STEADY, moved, scale_of
from ico3d.capture.capture import Capture
from ico3d.capture.face.landmarks import MULTI_PIE
from ico3d.capture.face.mediapipe_face import CanonicalFace, FaceReader, canonical_face
from ico3d.capture.headpose.shape import similarity_fit
from ico3d.capture.headpose.triangulation import misses, sightings
from ico3d.capture.headtrack.faces import Finder, Head
from ico3d.common.camera import Camera, look_at
from ico3d.common.spread import spread
from ico3d.common.weights import model_file
from ico3d.errors import CaptureError, ModelError
from ico3d.splat.gaussians import Gaussians

PURPOSE = "finding the face of a head whose capture had no landmarks"
AZIMUTHS, ELEVATIONS = (-36, -18, 0, 18, 36), (-15, 0, 15)
"""Directions in degrees, relative to that of the face, from which cameras look at it."""
DISTANCE, WIDE, PIXELS = 1.35, 0.5, 448
"""Such a camera: metres to the head, metres that its picture shows, and side in pixels."""
ROUNDS = 3
"""Rounds of pictures; the face found in one round places the cameras of the next."""
CANDIDATES = 6
"""Most results of `first_looks` that are examined."""
LEAST_VIEWS = 0.6
"""Share of the views that must show the same face."""
MOST_APART = 0.004
"""Most metres, on a face of usual size, by which these views may disagree."""
FRAMES = 10
"""Most frames of a body's recording in which the face is looked for."""
STRAYING = 0.012
"""Most metres of the landmarks' median deviation between frames; lips and noise cause less."""
COUNTED = np.array([MULTI_PIE[mark] for mark in STEADY])
"""Indices of MediaPipe's landmarks at the Multi-PIE landmarks of `STEADY`."""


@dataclass(frozen=True)
class FoundFace:
    """Landmarks of a face, and how certain they are.

    Attributes:
        marks: (68, 3) Multi-PIE landmarks for each frame: of a head in the space of its model, of a
            recorded person in canonical head space, metres.
        apart: Root mean square distance between the views' rays and the landmarks of nose, eyes and
            lips, metres.
        views: Number of pictures in which the face was found.
        looks: Number of pictures in which it was looked for.
    """

    marks: dict[int, np.ndarray]
    apart: float
    views: int
    looks: int

    @property
    def landmarks(self) -> np.ndarray:
        """(68, 3) landmarks: medians over the frames."""
        return np.median(list(self.marks.values()), axis=0)


class FaceSeeker:
    """Finds faces of heads and of recorded people with one tracker."""

    def __init__(self, reader: FaceReader, canonical: CanonicalFace):
        """Makes a seeker.

        Args:
            reader: Tracks faces in pictures.
            canonical: The canonical face model of the tracker.
        """
        self._reader, self._canonical = reader, canonical

    def of_head(self, gaussians: Gaussians, folder: Path) -> FoundFace:
        """Finds the face of a head in pictures drawn of it.

        Args:
            gaussians: The head with a neutral face, in any orientation and unit.
            folder: Where the head comes from, for error messages.

        Raises:
            ModelError: If no view shows a face, or views do not agree on one.
        """
        places = islice(first_looks(gaussians, self._canonical, self._reader), CANDIDATES)
        best = None
        for place in places:
            found = self._from_around(gaussians, place)
            if found is None:
                continue
            limit = MOST_APART * scale_of(place)
            if found.views >= LEAST_VIEWS * found.looks and found.apart < limit:
                return found
            best = found if best is None or found.views > best.views else best
        raise ModelError(_doubt(folder, best))

    def _from_around(self, gaussians: Gaussians, place: np.ndarray) -> FoundFace | None:
        """Finds the face in views around a rough place.

        Args:
            gaussians: The head.
            place: (4, 4) similarity from the canonical face to the head.

        Returns:
            The face in the space of the head; None if the views show none.
        """
        cameras, ahead = _cameras(), Head(np.zeros(0), np.zeros(3), np.array([0.0, 0, 1]), {})
        marks, apart, head = np.zeros(0), 0.0, ahead
        for _ in range(ROUNDS):
            studio = DrawnHead(gaussians.transform(np.linalg.inv(place)), cameras)
            with closing(Finder(lambda s=studio: s, self._canonical, [self._reader])) as finder:
                head = finder.find(0, ahead)
            if head is None:
                return None
            marks, apart = (
                moved(place, head.points[MULTI_PIE]),
                scale_of(place) * _apart(studio, head),
            )
            place = place @ self._fit(head.points)
        return FoundFace({0: marks}, apart, len(head.faces), len(cameras))

    def of_body(self, capture: Capture, poses: np.ndarray) -> FoundFace | None:
        """Finds the face of a recorded person in some frames.

        Args:
            capture: The recording of the person.
            poses: (F, 4, 4) head pose in each frame.

        Returns:
            The face in canonical head space; None where it is found in no frame.

        Raises:
            CaptureError: If the face does not move as the head poses do.
        """
        marks, views, aparts, last = {}, 0, [], None
        with closing(Finder(lambda: capture, self._canonical, [self._reader])) as finder:
            for frame in spread(capture.num_frames, FRAMES):
                before = None if last is None else _carried(last, poses[frame])
                head = finder.find(frame, before)
                if head is None:
                    continue
                last = _carried(head, np.linalg.inv(poses[frame]))
                marks[frame] = last.points[MULTI_PIE]
                aparts.append(_apart(capture, head))
                views += len(head.faces)
        if not marks:
            return None
        apart = float(np.sqrt(np.square(aparts).mean()))
        found = FoundFace(marks, apart, views, len(marks) * len(capture.cameras))
        _check_motion(capture, found)
        return found

    def _fit(self, points: np.ndarray) -> np.ndarray:
        """(4, 4) similarity that takes the canonical face to points (468, 3)."""
        face = self._canonical
        return similarity_fit(face.vertices, points[None], np.maximum(face.rigidity, LEAST_HELD))[0]


@contextmanager
def face_seeker() -> Iterator[FaceSeeker]:
    """A context with a seeker that uses MediaPipe's face landmarker; closes it in the end.

    Raises:
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If the face landmarker's file is not there.
    """
    model = model_file("face_landmarker.task", PURPOSE)
    with FaceReader(model) as reader:
        yield FaceSeeker(reader, canonical_face(model))


def _check_motion(capture: Capture, found: FoundFace) -> None:
    """Checks that a face moves as the head poses do.

    Raises:
        CaptureError: If its landmarks deviate by more than `STRAYING` in canonical head space.
    """
    away = np.linalg.norm(np.stack([*found.marks.values()]) - found.landmarks, axis=-1)  # (F, 68)
    stray = float(np.median(away[:, list(STEADY)]))
    if stray > STRAYING:
        raise CaptureError(
            f"{capture.path}: the face is found {1e3 * stray:.0f} mm from where the head poses "
            "take it: find them anew with ico3d capture track."
        )


def _doubt(folder: Path, best: FoundFace | None) -> str:
    """Error message: why no face was found, and what to do."""
    mend = "train it on a recording that shows the face from in front, or one that has landmarks"
    if best is None:
        return f"{folder}: no view drawn of this head, from all sides, shows a face: {mend}."
    return (
        f"{folder}: of {best.looks} views drawn of this head {best.views} show one face, within "
        f"{1e3 * best.apart:.1f} mm; that is too vague to place it: {mend}."
    )


def _cameras() -> list[Camera]:
    """Cameras in front of a head at the origin that looks along +z."""
    focal = PIXELS * DISTANCE / WIDE
    intrinsics = np.array([[focal, 0, PIXELS / 2], [0, focal, PIXELS / 2], [0, 0, 1]])
    turns = [Rotation.from_euler("YX", (a, -e), degrees=True) for e in ELEVATIONS for a in AZIMUTHS]
    poses = [look_at(turn.apply([0, 0, DISTANCE]), np.zeros(3)) for turn in turns]
    return [Camera(PIXELS, PIXELS, intrinsics, pose, str(n)) for n, pose in enumerate(poses)]


def _carried(head: Head, motion: np.ndarray) -> Head:
    """A head moved by a rigid motion (4, 4), without its faces in pictures."""
    turn = motion[:3, :3]
    return Head(moved(motion, head.points), moved(motion, head.center), turn @ head.forward, {})


def _apart(capture: Capture, head: Head) -> float:
    """Root mean square distance in metres between the views' rays and the landmarks that count."""
    cameras = [capture.cameras[camera] for camera in head.faces]
    pixels = np.stack([face.landmarks[COUNTED] for face in head.faces.values()])  # (C, P, 2)
    away = misses(sightings(cameras, pixels), head.points[COUNTED])  # (C, P)
    return float(np.sqrt(np.square(away).mean()))
