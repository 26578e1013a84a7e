"""The shoulders of a portrait, which do not turn with the head.

Gaussians lie in canonical head space, so all of them would follow the head. A portrait shows
shoulders as well, and those stand nearly still while a head turns above them: they keep the place
that they have on average, but for what the pictures show them to move by.
"""

from collections.abc import Callable

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.capture.face.canonical import canonical_landmarks
from ico3d.capture.face.region import CHIN, JAW_ENDS
from ico3d.common.spread import spread
from ico3d.head.portrait.neck import Neck, bent
from ico3d.head.portrait.shift import Seen, shift
from ico3d.head.views import PictureCache, View, head_pose
from ico3d.splat.gaussians import Gaussians

COLUMN = 1.1
"""Width of what may be neck in a picture, relative to that of the jaw."""
MOMENTS = 64
"""Number of frames over which the shoulders' place is averaged."""

Look = Callable[[int], tuple[np.ndarray, np.ndarray] | None]
"""Brightness (H, W) of a frame's picture and the mask (H, W) of shoulders and neck in it; None
where the camera saw none."""


def neck_of(capture: Capture) -> Neck | None:
    """Where the neck of a portrait bends.

    Args:
        capture: The recording.

    Returns:
        None where the recording is no portrait by one camera that shows shoulders, or has no
        landmarks.
    """
    alone = capture.shows == "head" and len(capture.cameras) == 1
    if not alone or not capture.tells_head or capture.moves_behind:
        return None
    landmarks = canonical_landmarks(capture)
    if landmarks is None:
        return None
    ends = landmarks[list(JAW_ENDS)]  # (2, 3)
    middle = ends.mean(0)  # (3,)
    x, y, z = (round(float(value), 6) for value in middle)
    reach = float(np.linalg.norm(landmarks[CHIN] - middle))
    width = float(np.linalg.norm(ends[1] - ends[0]))
    return Neck((x, y, z), round(reach, 6), round(width, 6))


def resting_place(capture: Capture) -> np.ndarray:
    """(4, 4) canonical head space to world, as the shoulders of a portrait lie on average."""
    poses = np.stack([head_pose(capture, frame) for frame in _moments(capture)])  # (M, 4, 4)
    place = np.eye(4)
    place[:3, :3] = Rotation.from_matrix(poses[:, :3, :3]).mean().as_matrix()
    place[:3, 3] = poses[:, :3, 3].mean(0)
    return place


class Shoulders:
    """Where the shoulders of a portrait are in each frame, against the head."""

    def __init__(self, capture: Capture, neck: Neck, look: Look):
        """Finds where the shoulders lie on average.

        Args:
            capture: A portrait by one camera.
            neck: Where the neck bends.
            look: What the camera saw of the shoulders in a frame.
        """
        self._capture, self._neck, self._look = capture, neck, look
        self._place = resting_place(capture)
        self._motions: dict[int, Tensor] = {}
        camera, middle = capture.cameras[0], self._place @ [*neck.middle, 1.0]  # (4,)
        pixel, depth = camera.project(middle[:3])  # (2,), ()
        self._metres = float(depth / camera.intrinsics[0, 0])  # per pixel
        away = np.abs(np.arange(camera.width) - pixel[0])  # (W,)
        self._column = away < COLUMN * neck.width / 2 / self._metres  # (W,) where the neck may be
        first = next((f for f in capture.split.train if _has_pose(capture, f)), None)
        self._first = None if first is None else self._seen(first)
        self._mean = np.mean([self._shift(frame) for frame in _moments(capture)], axis=0)  # (2,)

    def posed(self, gaussians: Gaussians, frame: int) -> Gaussians:
        """Gaussians in canonical head space, with the shoulders where they are in a frame."""
        return bent(gaussians, self._neck.follows(gaussians.means), self.motion(frame))

    def motion(self, frame: int) -> Tensor:
        """(4, 4) motion of the shoulders in canonical head space from their place on average."""
        if frame not in self._motions:
            motion = np.linalg.inv(head_pose(self._capture, frame)) @ self.place(frame)
            self._motions[frame] = torch.from_numpy(motion).float()
        return self._motions[frame]

    def place(self, frame: int) -> np.ndarray:
        """(4, 4) canonical head space to world, for whatever moves with the shoulders."""
        place = self._place.copy()
        away = np.append((self._shift(frame) - self._mean) * self._metres, 0)  # (3,)
        place[:3, 3] += self._capture.cameras[0].camera_to_world[:3, :3] @ away
        return place

    def _shift(self, frame: int) -> np.ndarray:
        """(2,) pixels by which the shoulders lie beside those of the first frame; 0 if unseen."""
        if self._first is None:
            return np.zeros(2)
        now = self._seen(frame)
        return np.zeros(2) if now is None else shift(self._first, now)

    def _seen(self, frame: int) -> Seen | None:
        """The shoulders in a frame's picture."""
        looked = self._look(frame)
        if looked is None:
            return None
        grey, mask = looked
        return Seen(grey, mask, np.broadcast_to(self._column, mask.shape))


def shoulders_of(capture: Capture, neck: Neck | None, pictures: PictureCache) -> Shoulders | None:
    """The shoulders in the pictures of a portrait.

    Args:
        capture: The recording.
        neck: Where the model's neck bends; None where it does not.
        pictures: The recording's pictures.

    Returns:
        None where all follows the head.
    """
    if neck is None or neck_of(capture) is None:
        return None

    def look(frame: int) -> tuple[np.ndarray, np.ndarray] | None:
        if not capture.has_image(0, frame) or not capture.has_mask(0, frame):
            return None
        picture = pictures.picture(View(0, frame, capture.cameras[0]), torch.device("cpu"))
        if picture.torso is None:
            return None
        return picture.image.mean(-1).numpy(), picture.torso.numpy()

    return Shoulders(capture, neck, look)


def _moments(capture: Capture) -> list[int]:
    """Frames with a head pose, spread over the recording."""
    return [frame for frame in spread(capture.num_frames, MOMENTS) if _has_pose(capture, frame)]


def _has_pose(capture: Capture, frame: int) -> bool:
    pose = capture.world_from_head(frame)
    return pose is not None and bool(np.isfinite(pose).all())
