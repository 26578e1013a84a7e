"""The face of a head model, and that of a recorded person, as one and the same tracker sees them.

What MediaPipe calls the corner of an eye is not quite what a data set's own landmarks or a face
model call so. Where a head's face has to be looked for, the body's is looked for alike: what the
tracker errs by is then in both, and does not move the head.
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
"""Degrees from where the face looks to the cameras that look at it."""
DISTANCE, WIDE, PIXELS = 1.35, 0.5, 448
"""Metres from such a camera to the head, metres that its picture shows, and its size."""
ROUNDS = 3
"""Of pictures: each shows where the cameras of the next have to stand."""
CANDIDATES = 6
"""First looks that are followed up."""
LEAST_VIEWS = 0.6
"""Part of the views that must show one face."""
MOST_APART = 0.004
"""Metres, of a face of the usual size, that these may disagree by."""
FRAMES = 10
"""Of a body's recording that are looked at."""
STRAYING = 0.012
"""Metres by which half of the landmarks may stray from moment to moment: lips and noise do less."""
COUNTED = np.array([MULTI_PIE[mark] for mark in STEADY])


@dataclass(frozen=True)
class FoundFace:
    """Landmarks, and how sure they are.

    Attributes:
        marks: Moment to its (68, 3) Multi-PIE landmarks in canonical head space.
        apart: Root mean square distance by which rays of the views pass by nose, eyes and lips.
        views: Pictures that agree.
        looks: Pictures that were looked at.
    """

    marks: dict[int, np.ndarray]
    apart: float
    views: int
    looks: int

    @property
    def landmarks(self) -> np.ndarray:
        """(68, 3) of all moments: medians."""
        return np.median(list(self.marks.values()), axis=0)


class FaceSeeker:
    """Looks for faces with one tracker."""

    def __init__(self, reader: FaceReader, canonical: CanonicalFace):
        """Takes the tracker and its canonical face."""
        self._reader, self._canonical = reader, canonical

    def of_head(self, gaussians: Gaussians, folder: Path) -> FoundFace:
        """The face of a head, drawn from several sides.

        Args:
            gaussians: The head with a neutral face; its axes and unit need not be the usual ones.
            folder: Where the head comes from, for errors.

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
        """The face that is roughly at a place (4, 4), in views around it; None if none is there."""
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
        """The face of a recorded person, in the space of the head poses.

        Args:
            capture: The recording of the person.
            poses: (F, 4, 4) head poses.

        Returns:
            The face; None where no moment shows it to two cameras.

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
    """A seeker whose model is closed in the end.

    Raises:
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If the face model is not there.
    """
    model = model_file("face_landmarker.task", PURPOSE)
    with FaceReader(model) as reader:
        yield FaceSeeker(reader, canonical_face(model))


def _check_motion(capture: Capture, found: FoundFace) -> None:
    """Whether a face moves as the head poses do.

    Raises:
        CaptureError: If not.
    """
    away = np.linalg.norm(np.stack([*found.marks.values()]) - found.landmarks, axis=-1)  # (F, 68)
    stray = float(np.median(away[:, list(STEADY)]))
    if stray > STRAYING:
        raise CaptureError(
            f"{capture.path}: the face is found {1e3 * stray:.0f} mm from where the head poses "
            "take it: find them anew with ico3d capture track."
        )


def _doubt(folder: Path, best: FoundFace | None) -> str:
    """Why no face was found, and what to do."""
    mend = "train it on a recording that shows the face from in front, or one that has landmarks"
    if best is None:
        return f"{folder}: no view drawn of this head, from all sides, shows a face: {mend}."
    return (
        f"{folder}: of {best.looks} views drawn of this head {best.views} show one face, within "
        f"{1e3 * best.apart:.1f} mm; that is too vague to place it: {mend}."
    )


def _cameras() -> list[Camera]:
    """On a cap before a head at 0 that looks along +z."""
    focal = PIXELS * DISTANCE / WIDE
    intrinsics = np.array([[focal, 0, PIXELS / 2], [0, focal, PIXELS / 2], [0, 0, 1]])
    turns = [Rotation.from_euler("YX", (a, -e), degrees=True) for e in ELEVATIONS for a in AZIMUTHS]
    poses = [look_at(turn.apply([0, 0, DISTANCE]), np.zeros(3)) for turn in turns]
    return [Camera(PIXELS, PIXELS, intrinsics, pose, str(n)) for n, pose in enumerate(poses)]


def _carried(head: Head, motion: np.ndarray) -> Head:
    """A head where a rigid motion (4, 4) takes it."""
    turn = motion[:3, :3]
    return Head(moved(motion, head.points), moved(motion, head.center), turn @ head.forward, {})


def _apart(capture: Capture, head: Head) -> float:
    """Metres, root mean square, by which the views' rays pass by the steady landmarks."""
    cameras = [capture.cameras[camera] for camera in head.faces]
    pixels = np.stack([face.landmarks[COUNTED] for face in head.faces.values()])  # (C, P, 2)
    away = misses(sightings(cameras, pixels), head.points[COUNTED])  # (C, P)
    return float(np.sqrt(np.square(away).mean()))
