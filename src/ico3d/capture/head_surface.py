"""The surface of a head from masks alone."""

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.hull import Silhouette, visual_hull

EDGE = 0.005
"""Metres of a voxel's edge."""


def head_hull(capture: Capture, frame: int) -> np.ndarray | None:
    """The visual hull of each camera's mask nearest in time: not all take all frames.

    Args:
        capture: With masks and head poses.
        frame: Which.

    Returns:
        (P, 3) in canonical head space, metres; None where poses, masks or a hull are lacking.
    """
    order = sorted(range(capture.num_frames), key=lambda other: (abs(other - frame), other))
    posed = [other for other in order if capture.world_from_head(other) is not None]
    found = (_silhouette(capture, camera, posed) for camera in range(len(capture.cameras)))
    hull = visual_hull([seen for seen in found if seen is not None], EDGE)
    return None if hull is None else hull.surface


def _silhouette(capture: Capture, camera: int, frames: list[int]) -> Silhouette | None:
    """The mask of the first of the frames that has one, as seen from head space."""
    for frame in frames:
        pose, mask = capture.world_from_head(frame), capture.mask(camera, frame)
        if pose is not None and mask is not None:
            return Silhouette.of(capture.cameras[camera].moved(pose), mask)
    return None
