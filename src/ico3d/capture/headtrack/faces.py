"""Finds the face of one moment in all cameras that see it."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.face.mediapipe_face import MESH_LANDMARKS, CanonicalFace, Face, FaceReader
from ico3d.capture.headpose.shape import similarity_fit
from ico3d.capture.headpose.triangulation import Sightings, agreeing, robust, sightings
from ico3d.capture.headtrack.crops import HEAD, Part, around, search
from ico3d.capture.pictures import train_cameras
from ico3d.errors import CaptureError

SEES_FACE = np.cos(np.radians(100.0))
"""Cosine of the angle to the face beyond which cameras are skipped; MediaPipe manages some 80°."""
SIDEWAYS = np.cos(np.radians(75.0))
"""Cosine of the angle to the face beyond which landmarks are mostly guessed."""
SPARSE = 6
"""Every 6th landmark is used to decide which cameras agree."""
LEAST_FRONTAL, LEAST_SIGHT = 0.02, 0.05
"""Least weights: of cameras at the side, and of landmarks that face away from a camera."""


@dataclass(frozen=True)
class Head:
    """A head at one moment.

    Attributes:
        points: (468, 3) landmarks in the world, metres.
        center: (3,) centre of the head in the world, metres.
        forward: (3,) unit direction of the face in the world.
        faces: Faces in the pictures of agreeing cameras, by camera; landmarks in pixels of the
            picture.
    """

    points: np.ndarray
    center: np.ndarray
    forward: np.ndarray
    faces: dict[int, Face]

    def frontality(self, capture: Capture, camera: int) -> float:
        """Cosine of the angle between the face's direction and the direction to a camera."""
        way = capture.cameras[camera].camera_to_world[:3, 3] - self.center
        return float(_cosine(self.forward, way))

    def most_frontal(self, capture: Capture) -> int:
        """Index of the camera that sees the face best, among those that agree."""
        return max(self.faces, key=lambda camera: self.frontality(capture, camera))


class Finder:
    """Finds the head in the pictures of all cameras but those for tests, with several threads.

    Attributes:
        capture: The recording.
        disagreements: Number of moments at which cameras showed faces, but no two the same face.
    """

    def __init__(
        self,
        open_capture: Callable[[], Capture],
        canonical: CanonicalFace,
        readers: Sequence[FaceReader],
    ):
        """Opens the capture once for each camera, so that videos are decoded in parallel.

        Args:
            open_capture: Opens the capture; with a single reader it may return an open one.
            canonical: MediaPipe's canonical face.
            readers: Face readers, one for each thread.
        """
        self.capture = open_capture()
        self._opened = [open_capture() for _ in self.capture.cameras]
        self._canonical, self._normals = canonical, vertex_normals(canonical)
        self._opposite = opposite_vertices(canonical)
        self._readers: SimpleQueue[FaceReader] = SimpleQueue()
        for reader in readers:
            self._readers.put(reader)
        self._pool = ThreadPoolExecutor(len(readers))
        self.disagreements = 0

    def close(self) -> None:
        """Stops the threads."""
        self._pool.shutdown(cancel_futures=True)

    def find(self, frame: int, before: Head | None) -> Head | None:
        """Finds the head in a frame.

        Args:
            frame: Number of the frame.
            before: The head in the frame before, or None.

        Returns:
            The head, or None if fewer than two cameras show the same face.
        """
        head = None if before is None else self._placed(self._near(frame, before))
        if head is not None:
            return head
        found = self._placed(self._everywhere(frame))
        if found is None:
            return None
        # Once more, now that all cameras know where to look: parts cut alike are read alike.
        return self._placed(self._near(frame, found)) or found

    def _near(self, frame: int, head: Head) -> dict[int, Face]:
        """Faces close to where the head was."""
        return self._look(frame, self._facing(head), lambda camera: self._around(camera, head))

    def _everywhere(self, frame: int) -> dict[int, Face]:
        """Faces anywhere on the person."""

        def parts(camera: int) -> list[Part]:
            lens = self.capture.cameras[camera]
            return search(lens.height, lens.width, self._opened[camera].mask(camera, frame))

        return self._look(frame, train_cameras(self.capture), parts)

    def _facing(self, head: Head) -> list[int]:
        """Cameras that may see the face."""
        return [
            camera
            for camera in train_cameras(self.capture)
            if head.frontality(self.capture, camera) > SEES_FACE and self._around(camera, head)
        ]

    def _around(self, camera: int, head: Head) -> list[Part]:
        """Parts of a picture around a head: close, and wider for one that moved."""
        lens = self.capture.cameras[camera]
        parts = [around(lens, head.center, size) for size in (HEAD, 1.5 * HEAD)]
        return [part for part in parts if part is not None]

    def _look(
        self, frame: int, cameras: Sequence[int], parts: Callable[[int], list[Part]]
    ) -> dict[int, Face]:
        """The first face that each camera shows in one of its parts."""

        def look(camera: int) -> Face | None:
            image = self._opened[camera].image(camera, frame)
            return None if image is None else self._read(image, parts(camera))

        found = zip(cameras, self._pool.map(look, cameras), strict=True)
        return {camera: face for camera, face in found if face is not None}

    def _read(self, image: np.ndarray, parts: list[Part]) -> Face | None:
        """The first face in one of the parts, landmarks in pixels of the picture."""
        reader = self._readers.get()
        try:
            for part in parts:
                face = self._both_ways(reader, part.cut(image))
                if face is not None:
                    return Face(part.whole(face.landmarks), face.blendshapes, face.pose)
            return None
        finally:
            self._readers.put(reader)

    def _both_ways(self, reader: FaceReader, picture: np.ndarray) -> Face | None:
        """The face in a picture; its landmarks read in the mirror, too: errors of sides cancel."""
        face = reader.read(picture)
        if face is None:
            return None
        other = reader.read(picture[:, ::-1])
        if other is None:
            return face
        landmarks = face.landmarks.copy()
        back = other.landmarks[self._opposite] * [-1, 1] + [picture.shape[1], 0]  # (468, 2)
        landmarks[:MESH_LANDMARKS] = (landmarks[:MESH_LANDMARKS] + back) / 2
        return Face(landmarks, face.blendshapes, face.pose)

    def _placed(self, faces: dict[int, Face]) -> Head | None:
        """The head that most cameras agree on."""
        if len(faces) < 2:
            return None
        cameras = [self.capture.cameras[camera] for camera in faces]
        pixels = np.stack([face.landmarks[:MESH_LANDMARKS] for face in faces.values()])
        seen = sightings(cameras, pixels)  # (C, 468)
        agree = agreeing(Sightings(seen.world_to_camera, seen.rays[:, ::SPARSE]))
        if not agree.any():
            self.disagreements += 1
            return None
        seen = seen.of(agree)
        points, _ = robust(seen, np.ones(seen.rays.shape[:2]))
        for _ in range(2):  # how well a camera sees a landmark depends on how the head is turned
            sight = self._sight(points, seen.centers)
            points, _ = robust(seen, sight)
        place = self._fit(points)
        kept = [camera for camera, ok in zip(faces, agree, strict=True) if ok]
        forward = place[:3, 2] / np.linalg.norm(place[:3, 2])
        return Head(points, place[:3, 3], forward, {camera: faces[camera] for camera in kept})

    def _fit(self, points: np.ndarray) -> np.ndarray:
        """(4, 4) similarity that takes the canonical face to points (468, 3)."""
        face = self._canonical
        return similarity_fit(face.vertices, points[None], np.maximum(face.rigidity, 1e-3))[0]

    def _sight(self, points: np.ndarray, centers: np.ndarray) -> np.ndarray:
        """(C, 468) in (0, 1]: how well cameras see the face, times how they see its skin there."""
        place = self._fit(points)
        normals = self._normals @ place[:3, :3].T
        skin = _cosine(normals, centers[:, None] - points)  # (C, 468)
        face = _cosine(place[:3, 2], centers - place[:3, 3])  # (C,)
        frontal = np.maximum((face - SIDEWAYS) / (1 - SIDEWAYS), LEAST_FRONTAL)
        return frontal[:, None] * np.maximum(skin, LEAST_SIGHT)


@contextmanager
def finder(
    open_capture: Callable[[], Capture], canonical: CanonicalFace, model: Path, workers: int
) -> Iterator[Finder]:
    """A finder whose threads and models are closed at the end of the `with` block.

    Raises:
        CaptureError: If the capture has only one camera.
    """
    with ExitStack() as stack:
        readers = [stack.enter_context(FaceReader(model)) for _ in range(workers)]
        found = Finder(open_capture, canonical, readers)
        stack.callback(found.close)
        if len(found.capture.cameras) < 2:
            raise CaptureError(
                f"{found.capture.path} has one camera, and a place in space takes two; "
                "ico3d capture portrait tracks videos of one camera."
            )
        yield found


def _cosine(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Of the angles between vectors (..., 3)."""
    lengths = np.linalg.norm(first, axis=-1) * np.linalg.norm(second, axis=-1)
    return (first * second).sum(-1) / lengths


def vertex_normals(face: CanonicalFace) -> np.ndarray:
    """(468, 3) outward unit normals: means of the adjacent triangles' normals, weighted by area."""
    corners = face.vertices[face.triangles]  # (T, 3, 3)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # (T, 3)
    normals = np.zeros_like(face.vertices)
    for corner in range(3):
        np.add.at(normals, face.triangles[:, corner], flat)
    if normals[:, 2].mean() < 0:
        normals = -normals  # the face looks along +z
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def opposite_vertices(face: CanonicalFace) -> np.ndarray:
    """(468,) index of the mirror-image vertex on the symmetric canonical face."""
    mirrored = face.vertices * [-1, 1, 1]
    return np.linalg.norm(mirrored[:, None] - face.vertices, axis=-1).argmin(1)
