"""Colours of parts of a person, read off pictures that are drawn of them.

A picture shows what a visitor sees; colours of single Gaussians do not, as many lie below the
surface or cover one another.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from ico3d.avatar.joining.finding.drawn_head import DrawnHead
from ico3d.avatar.joining.similarity import moved
from ico3d.common.camera import Camera, look_at
from ico3d.splat.gaussians import Gaussians

Where = Callable[[np.ndarray], np.ndarray]
"""Tells of points (P, 3) which of them belong to a part: (P,) bool."""
DIRECTIONS = ((-75, 25), (-35, 5), (0, 0), (35, 5), (75, 25), (0, 60))
"""Azimuth and elevation in degrees of the cameras about a head that looks along +z."""
DISTANCE, WIDE, PIXELS = 1.4, 0.42, 192
"""Such a camera: metres to the head, metres that its picture shows, and side in pixels."""
COVERED = 0.9
"""Alpha above which a pixel shows the surface alone."""
LEAST_PIXELS = 40
"""Pixels that a colour takes."""
DARKEST = 0.004
"""Least distance of a display colour from 0 and from 1, so that its logit is finite."""


def drawn_colors(
    gaussians: Gaussians, middle: np.ndarray, parts: Sequence[Where]
) -> list[np.ndarray | None]:
    """The median colour of each of some parts of a head's surface.

    Args:
        gaussians: The head, or the body about it, in canonical head space.
        middle: (3,) point at which the cameras look.
        parts: Tell which points of the surface belong to a part.

    Returns:
        For each part (3,) logits of r, g, b; None where the pictures show too little of it.
    """
    studio = DrawnHead(gaussians, _cameras(middle))
    found: list[list[np.ndarray]] = [[] for _ in parts]
    for number, camera in enumerate(studio.cameras):
        drawn = studio.drawn(number)
        seen = drawn.alpha[0].cpu().numpy() > COVERED  # (H, W)
        rows, columns = np.nonzero(seen)
        depths = drawn.depth[0].cpu().numpy()[seen]  # (P,)
        ends = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))], 1)  # (P, 3)
        local = ends @ np.linalg.inv(camera.intrinsics).T * depths[:, None]
        points = moved(camera.camera_to_world, local)  # (P, 3)
        colors = drawn.rgb[0].cpu().numpy()[seen]  # (P, 3)
        for shown, part in zip(found, parts, strict=True):
            shown.append(colors[part(points)])
    return [_median(np.concatenate(shown)) for shown in found]


def logits(colors: np.ndarray) -> np.ndarray:
    """Logits of display colours."""
    inside = colors.clip(DARKEST, 1 - DARKEST)
    return np.log(inside / (1 - inside))


def _median(colors: np.ndarray) -> np.ndarray | None:
    return logits(np.median(colors, axis=0)) if len(colors) >= LEAST_PIXELS else None


def _cameras(middle: np.ndarray) -> list[Camera]:
    focal = PIXELS * DISTANCE / WIDE
    intrinsics = np.array([[focal, 0, PIXELS / 2], [0, focal, PIXELS / 2], [0, 0, 1]])
    turns = [Rotation.from_euler("YX", (a, -e), degrees=True) for a, e in DIRECTIONS]
    poses = [look_at(middle + turn.apply([0, 0, DISTANCE]), middle) for turn in turns]
    return [Camera(PIXELS, PIXELS, intrinsics, pose) for pose in poses]
