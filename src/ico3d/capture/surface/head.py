"""The surface of a head from masks alone (visual hull)."""

from collections.abc import Sequence

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.surface.hull import Silhouette, visual_hull

EDGE = 0.005
"""Edge of a voxel, metres."""


def head_hull(capture: Capture, frame: int) -> np.ndarray | None:
    """The visual hull of a head in a frame.

    Cameras that did not record the frame contribute their mask nearest in time.

    Args:
        capture: A recording with masks and head poses.
        frame: Number of the frame.

    Returns:
        (P, 3) surface points in canonical head space, metres; None without poses, masks or a hull.
    """
    seen = head_silhouettes(capture, frame, range(capture.num_frames))
    hull = visual_hull(list(seen.values()), EDGE)
    return None if hull is None else hull.surface


def head_silhouettes(capture: Capture, frame: int, among: Sequence[int]) -> dict[int, Silhouette]:
    """Each camera's mask nearest in time to a frame, with the camera in canonical head space.

    Args:
        capture: A recording with masks and head poses.
        frame: Number of the frame.
        among: Frames whose masks may be used.

    Returns:
        Silhouettes by number of the camera, for cameras with a mask of a frame with a head pose.
    """
    order = sorted(among, key=lambda other: (abs(other - frame), other))
    posed = [other for other in order if capture.world_from_head(other) is not None]
    cameras = range(len(capture.cameras))
    found = {camera: _silhouette(capture, camera, posed) for camera in cameras}
    return {camera: seen for camera, seen in found.items() if seen is not None}


def _silhouette(capture: Capture, camera: int, frames: list[int]) -> Silhouette | None:
    """The mask of the first of the frames that has one, as seen from head space."""
    for frame in frames:
        pose, mask = capture.world_from_head(frame), capture.mask(camera, frame)
        if pose is not None and mask is not None:
            return Silhouette.of(capture.cameras[camera].moved(pose), mask)
    return None
