"""Any recording with the head that `ico3d capture track` found in it."""

import numpy as np

from ico3d.capture.capture import Capture, Sound
from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.finding import Finding
from ico3d.capture.headpose.track_file import HeadTrack, read_track
from ico3d.capture.surface.head import head_hull
from ico3d.errors import CaptureError


class TrackedCapture(Capture):
    """A recording whose head is that of a track; everything else is its own.

    Attributes:
        whole: The recording itself, for what only its format has.
    """

    blendshape_names = BLENDSHAPES

    def __init__(self, capture: Capture, track: HeadTrack):
        """Wraps an open capture."""
        self.whole, self._track = capture, track
        self.kind, self.path, self.cameras = capture.kind, capture.path, capture.cameras
        self.fps, self.num_frames, self.split = capture.fps, capture.num_frames, capture.split

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The recorded picture."""
        return self.whole.image(camera, frame)

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The person."""
        return self.whole.mask(camera, frame)

    def head_mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The part that is measured."""
        return self.whole.head_mask(camera, frame)

    def background(self, camera: int) -> np.ndarray | None:
        """What the camera sees without the person."""
        return self.whole.background(camera)

    def audio(self) -> Sound | None:
        """The sound."""
        return self.whole.audio()

    def world_from_head(self, frame: int) -> np.ndarray:
        """(4, 4) as it was tracked."""
        return self._track.world_from_head[self._index(frame)]

    def eyes(self, frame: int) -> np.ndarray:
        """(7,) tracked eye and brow values of a frame."""
        return self._track.eyes[self._index(frame)]

    def blendshapes(self, frame: int) -> np.ndarray:
        """(52,) tracked blendshapes of a frame."""
        return self._track.blendshapes[self._index(frame)]

    def landmarks_3d(self, frame: int) -> np.ndarray:
        """(68, 3) tracked landmarks of a frame in canonical head space, metres."""
        return self._track.landmarks[self._index(frame)]

    def landmarks(self, camera: int, frame: int) -> np.ndarray:
        """(68, 2) the tracked landmarks in pixels of the camera, wherever it looks."""
        seen = self.cameras[camera].moved(self.world_from_head(frame))
        return seen.project(self.landmarks_3d(frame))[0]

    def points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) the recording's own: of heads, moved to the head space of the track."""
        points = self.whole.points(frame)
        if not self.split.test:  # a body, whose points lie in the world
            return points
        pose = self.whole.world_from_head(frame)
        if points is None or pose is None:
            return head_hull(self, frame)
        between = np.linalg.inv(self.world_from_head(frame)) @ pose
        return points @ between[:3, :3].T + between[:3, 3]

    def inspect(self) -> list[Finding]:
        """What is wrong with the files of the recording, and where its head is interpolated."""
        return [*self.whole.inspect(), self._track.finding()]

    @property
    def provenance(self) -> dict:
        """What the recording says of itself: the track adds nothing."""
        return self.whole.provenance

    def _index(self, frame: int) -> int:
        if not 0 <= frame < self.num_frames:
            raise CaptureError(f"{self.path} has frames 0 to {self.num_frames - 1}, not {frame}.")
        return frame


def with_track(capture: Capture) -> Capture:
    """A recording of any format with the track that lies beside it, if one does.

    Raises:
        CaptureError: If the track is damaged or belongs to another recording.
    """
    if capture.kind == "multiview":  # reads its own
        return capture
    track = read_track(capture.path, capture.num_frames, len(capture.cameras))
    return capture if track is None else TrackedCapture(capture, track)
