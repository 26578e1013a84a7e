"""The surface of a head from masks alone."""

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.hull import Silhouette, visual_hull

EDGE = 0.005
"""Metres of a voxel's edge."""


def head_hull(capture: Capture, frame: int) -> np.ndarray | None:
    """The visual hull of the masks of a frame.

    Args:
        capture: With masks and head poses.
        frame: Which.

    Returns:
        (P, 3) in canonical head space, metres; None where poses, masks or a hull are lacking.
    """
    pose = capture.world_from_head(frame)
    if pose is None:
        return None
    seen = []
    for index, camera in enumerate(capture.cameras):
        mask = capture.mask(index, frame)
        if mask is not None:
            seen.append(Silhouette.of(camera, mask))
    hull = visual_hull(seen, EDGE)
    return None if hull is None else (hull.surface - pose[:3, 3]) @ pose[:3, :3]
