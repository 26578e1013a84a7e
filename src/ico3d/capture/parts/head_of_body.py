"""The head in a recording of the whole body: its pictures are crops about the head."""

import numpy as np

from ico3d.capture.box import Box, cut_out
from ico3d.capture.capture import Capture
from ico3d.capture.decoding import to_bytes
from ico3d.capture.face.canonical import canonical_landmarks
from ico3d.capture.parts.head_solid import HeadSolid
from ico3d.capture.parts.over_torso import HeadOverTorso
from ico3d.capture.parts.wrapped import WrappedCapture
from ico3d.capture.surface.head import EDGE
from ico3d.capture.surface.hull import Silhouette, visual_hull
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.errors import CaptureError

MARGIN = 0.1
"""Margin about the head in a crop, relative to the longer side of the head's box."""
LEAST = 8
"""Least width and height in pixels of a crop; where the head is smaller, nothing is cropped."""
MOMENTS = 8
"""Number of frames whose surface points are joined: a head is rigid but for the face."""


class HeadOfBody(WrappedCapture):
    """A capture of the body as a capture of its head.

    All pictures of a camera have one crop, which holds the head in every frame, with the camera's
    principal point shifted to match. `head_mask` are the person's pixels within the outline of
    `HeadSolid`; neck, shoulders and hands beside the head are of the person but not of the head.
    Pictures of a camera that never sees the head seem not recorded.
    """

    def __init__(self, capture: Capture):
        """Finds the crops, from head poses and landmarks alone.

        Args:
            capture: A capture that shows the body, with head poses, landmarks and masks.

        Raises:
            CaptureError: If head poses or landmarks are missing, or no camera sees the head.
            ModelError: If the landmarks do not span a face.
        """
        super().__init__(capture)
        self.tells_head = True
        landmarks = canonical_landmarks(capture)
        frames = [frame for frame in range(capture.num_frames) if self._pose(frame) is not None]
        if landmarks is None or not frames:
            raise CaptureError(
                f"{capture.path} shows the whole body and tells of no head: "
                "find it with ico3d capture track."
            )
        self._solid = HeadSolid.around(landmarks)
        crops = [self._crop(camera, frames) for camera in capture.cameras]
        self._crops = tuple(crops)
        if not any(crops):
            raise CaptureError(f"{capture.path}: no camera sees the head: check the head's poses.")
        self.cameras = tuple(
            camera if box is None else camera.cropped(*box.place)
            for camera, box in zip(capture.cameras, crops, strict=True)
        )

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether the head's picture was recorded."""
        return self._crops[camera] is not None and self.whole.has_image(camera, frame)

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether the head's picture has a mask."""
        return self._crops[camera] is not None and self.whole.has_mask(camera, frame)

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The picture, cropped."""
        return self._cropped(self.whole.image(camera, frame), camera)

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask of the person, cropped."""
        return self._cropped(self.whole.mask(camera, frame), camera)

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the cropped picture in a box, uint8."""
        crop = self._crops[camera]
        return self.whole.image_bytes(camera, frame, _inside(crop, box)) if crop else None

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the cropped mask in a box, uint8."""
        crop = self._crops[camera]
        return self.whole.mask_bytes(camera, frame, _inside(crop, box)) if crop else None

    def head_mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The part of the head's cropped mask in a box, uint8."""
        found = self.head_mask(camera, frame)
        return None if found is None else to_bytes(cut_out(found, box))

    def head_mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask of the head, cropped."""
        mask, pose = self.mask(camera, frame), self._pose(frame)
        if mask is None or pose is None:
            return None
        return mask * self._solid.covered(self.cameras[camera].moved(pose))

    def background(self, camera: int) -> np.ndarray | None:
        """What the camera sees without the person, cropped."""
        return self._cropped(self.whole.background(camera), camera)

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) landmarks in pixels of the crop."""
        marks, crop = self.whole.landmarks(camera, frame), self._crops[camera]
        return None if marks is None or crop is None else marks - (crop.left, crop.top)

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) the body's surface points of some frames that lie in the head, in head space.

        Where the recording has no surface points: the visual hull of the head at the frame.
        """
        moments = [other for other in spread(self.num_frames, MOMENTS)]
        found = [part for other in moments if (part := self._points_at(other)) is not None]
        return np.concatenate(found) if found else self._hull(frame)

    def world_points(self, frame: int = 0) -> None:
        """None: a head's points are those of `head_points`."""
        return None

    def _pose(self, frame: int) -> np.ndarray | None:
        """(4, 4) the head pose of a frame; None where it is unknown."""
        pose = self.whole.world_from_head(frame)
        return None if pose is None or not np.isfinite(pose).all() else pose

    def _points_at(self, frame: int) -> np.ndarray | None:
        """(P, 3) surface points of a frame that lie in the head, in head space."""
        points, pose = self.whole.world_points(frame), self._pose(frame)
        if points is None or pose is None:
            return None
        local = (points - pose[:3, 3]) @ pose[:3, :3]  # (P, 3)
        return local[self._solid.holds(local)]

    def _hull(self, frame: int) -> np.ndarray | None:
        """(P, 3) the visual hull of the head, in head space."""
        pose = self._pose(frame)
        if pose is None:
            return None
        masks = ((camera, self.head_mask(camera, frame)) for camera in range(len(self.cameras)))
        seen = [
            Silhouette.of(self.cameras[camera].moved(pose), mask)
            for camera, mask in masks
            if mask is not None
        ]
        hull = visual_hull(seen, EDGE)
        return None if hull is None else hull.surface[self._solid.holds(hull.surface)]

    def _crop(self, camera: Camera, frames: list[int]) -> Box | None:
        """A camera's crop; None where it does not see the head."""
        boxes = [self._solid.box(camera.moved(self._pose(frame))) for frame in frames]  # type: ignore[arg-type]
        seen = np.array([box for box in boxes if box is not None])  # (F, 4)
        if not len(seen):
            return None
        low, high = seen[:, :2].min(0), seen[:, 2:].max(0)
        margin = int(np.ceil(MARGIN * (seen[:, 2:] - seen[:, :2]).max()))
        size = (camera.width, camera.height)
        left, top = (low - margin).clip(0, size).tolist()
        right, bottom = (high + margin).clip(0, size).tolist()
        crop = Box(left, top, right - left, bottom - top)
        return crop if min(crop.width, crop.height) >= LEAST else None

    def _cropped(self, picture: np.ndarray | None, camera: int) -> np.ndarray | None:
        """A picture (H, W, ...) of the whole capture cropped to (h, w, ...)."""
        crop = self._crops[camera]
        return None if picture is None or crop is None else np.ascontiguousarray(picture[crop.cut])


def head_in(capture: Capture, over_torso: bool = False) -> Capture:
    """The capture if it shows a head, else the head in it.

    Args:
        capture: The recording.
        over_torso: Whether only the head of a portrait is meant, over the recorded torso.

    Raises:
        CaptureError: If the body's capture tells of no head, or a portrait of no torso.
    """
    if over_torso:
        return HeadOverTorso(capture)
    return capture if capture.shows == "head" else HeadOfBody(capture)


def _inside(crop: Box, box: Box | None) -> Box:
    """A box in pixels of a crop as a box in pixels of the whole picture; the crop for None."""
    if box is None:
        return crop
    return Box(crop.left + box.left, crop.top + box.top, box.width, box.height)
