"""A capture that shows another capture in another way."""

import numpy as np

from ico3d.capture.box import Box
from ico3d.capture.capture import Capture, Sound
from ico3d.capture.finding import Finding
from ico3d.capture.smplx import SmplX
from ico3d.rig.body_track import BodyTrack


class WrappedCapture(Capture):
    """Gives what the wrapped capture gives; classes derived from it change a part of that.

    Attributes:
        whole: The wrapped capture.
    """

    def __init__(self, capture: Capture):
        """Wraps an open capture."""
        self.whole = capture
        self.kind, self.path, self.shows = capture.kind, capture.path, capture.shows
        self.cameras, self.split = capture.cameras, capture.split
        self.fps, self.num_frames = capture.fps, capture.num_frames
        self.blendshape_names, self.tells_head = capture.blendshape_names, capture.tells_head
        self.moves_behind = self.moves_behind or capture.moves_behind

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether the wrapped capture has the picture."""
        return self.whole.has_image(camera, frame)

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether the wrapped capture has a mask of the person."""
        return self.whole.has_mask(camera, frame)

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The recorded picture."""
        return self.whole.image(camera, frame)

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask of the person."""
        return self.whole.mask(camera, frame)

    def head_mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask for `psnr_mask`."""
        return self.whole.head_mask(camera, frame)

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the picture in a box, uint8."""
        return self.whole.image_bytes(camera, frame, box)

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the mask in a box, uint8."""
        return self.whole.mask_bytes(camera, frame, box)

    def head_mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the mask for `psnr_mask` in a box, uint8."""
        return self.whole.head_mask_bytes(camera, frame, box)

    def background(self, camera: int) -> np.ndarray | None:
        """What the camera sees without the person."""
        return self.whole.background(camera)

    def behind(self, camera: int, frame: int) -> np.ndarray | None:
        """What the camera sees in a frame without what the mask shows."""
        if self.whole.moves_behind:
            return self.whole.behind(camera, frame)
        return self.background(camera)

    def torso(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W, 4) what a portrait shows below the head."""
        return self.whole.torso(camera, frame)

    def audio(self) -> Sound | None:
        """The sound."""
        return self.whole.audio()

    def world_from_head(self, frame: int) -> np.ndarray | None:
        """The head pose (4, 4) of a frame."""
        return self.whole.world_from_head(frame)

    def eyes(self, frame: int) -> np.ndarray | None:
        """(7,) eye and brow values of a frame."""
        return self.whole.eyes(frame)

    def blendshapes(self, frame: int) -> np.ndarray | None:
        """Blendshape weights of a frame."""
        return self.whole.blendshapes(frame)

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) landmarks in pixels of a camera."""
        return self.whole.landmarks(camera, frame)

    def landmarks_3d(self, frame: int) -> np.ndarray | None:
        """(68, 3) landmarks in canonical head space, metres."""
        return self.whole.landmarks_3d(frame)

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) surface points in canonical head space, metres."""
        return self.whole.head_points(frame)

    def world_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) surface points in the world, metres."""
        return self.whole.world_points(frame)

    def whole_body_points(self, frame: int) -> np.ndarray | None:
        """(133, 3) annotated points in the world, metres."""
        return self.whole.whole_body_points(frame)

    def smplx(self, frame: int) -> SmplX | None:
        """SMPL-X parameters of a frame."""
        return self.whole.smplx(frame)

    def body_track(self) -> BodyTrack | None:
        """The motion of the body."""
        return self.whole.body_track()

    def inspect(self) -> list[Finding]:
        """Findings about the files of the wrapped capture."""
        return self.whole.inspect()

    @property
    def provenance(self) -> dict:
        """The provenance of the wrapped capture."""
        return self.whole.provenance
