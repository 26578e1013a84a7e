"""A recording of any format, with the head that `ico3d capture track` found."""

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.face.expressions import BLENDSHAPES
from ico3d.capture.finding import Finding
from ico3d.capture.headpose.track_file import HeadTrack, read_track
from ico3d.capture.parts.wrapped import WrappedCapture
from ico3d.capture.surface.head import head_hull
from ico3d.errors import CaptureError


class TrackedCapture(WrappedCapture):
    """A recording whose data about the head come from a track.

    Attributes:
        whole: The wrapped recording, for methods that only its format has.
    """

    def __init__(self, capture: Capture, track: HeadTrack):
        """Wraps an open capture."""
        super().__init__(capture)
        self._track, self.blendshape_names = track, BLENDSHAPES

    def world_from_head(self, frame: int) -> np.ndarray:
        """The tracked head pose (4, 4) of a frame."""
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
        """(68, 2) tracked landmarks in pixels of a camera, even of one that sees no face."""
        seen = self.cameras[camera].moved(self.world_from_head(frame))
        return seen.project(self.landmarks_3d(frame))[0]

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) surface points of the head, in the track's head space; None of bodies."""
        if self.shows == "body":
            return None
        points, pose = self.whole.head_points(frame), self.whole.world_from_head(frame)
        if points is None or pose is None:
            return head_hull(self, frame)
        between = np.linalg.inv(self.world_from_head(frame)) @ pose
        return points @ between[:3, :3].T + between[:3, 3]

    def inspect(self) -> list[Finding]:
        """Findings about the recording's files, and about interpolated frames of the track."""
        return [*self.whole.inspect(), self._track.finding()]

    def _index(self, frame: int) -> int:
        if not 0 <= frame < self.num_frames:
            raise CaptureError(f"{self.path} has frames 0 to {self.num_frames - 1}, not {frame}.")
        return frame


def with_track(capture: Capture) -> Capture:
    """A recording with its head track if there is one, else the recording itself.

    Raises:
        CaptureError: If the track is damaged or belongs to another recording.
    """
    if capture.kind == "multiview":  # reads its own
        return capture
    track = read_track(capture.path, capture.num_frames, len(capture.cameras))
    return capture if track is None else TrackedCapture(capture, track)
