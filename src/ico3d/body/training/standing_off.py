"""What stands off the skin: clothes and hair, pulled back to rest from a frame's surface."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from ico3d.body.skinning.template import Skin
from ico3d.capture.capture import Capture
from ico3d.capture.pictures import train_cameras
from ico3d.rig.body_track import BodyTrack
from ico3d.splat.initial import in_pictures

OFF = 0.02
"""Metres from the skin, at which a hull of 2 cm voxels is told from it."""
FARTHEST = 0.25
"""Metres; what is farther from the skin is nobody's coat."""
INSIDE = 0.95
"""Part of the pictures of a place that must show the person there, at every frame looked at."""


def standing_off(
    skin: Skin,
    track: BodyTrack,
    capture: Capture,
    surface: np.ndarray,
    frame: int,
    others: Sequence[int],
) -> Skin:
    """The points of a frame's surface that stand off the skin, at rest.

    They hang on the joints of the nearest point of the skin. A hull fills what no camera can look
    into, under the arms and between the legs; elsewhere in other poses, that is found empty.

    Args:
        skin: Points on the template.
        track: How it moves.
        capture: Where masks come from.
        surface: (S, 3) the person's surface in the world, a visual hull for example.
        frame: When the surface was seen.
        others: Frames at which the points must lie on the person, too.
    """
    distance, _ = KDTree(skin.posed(track, frame)).query(surface)  # (S,)
    found = skin.pulled_back(surface[(distance > OFF) & (distance < FARTHEST)], track, frame)
    for other in others:
        found = found[_on_person(found.posed(track, other), capture, other)]
    return found


def _on_person(points: np.ndarray, capture: Capture, frame: int) -> np.ndarray:
    """(P,) bool: which places (P, 3) the masks of a frame show to be the person's."""
    held, shown = np.zeros(len(points)), np.zeros(len(points))
    for index in train_cameras(capture):
        mask = capture.mask(index, frame)
        if mask is None:
            continue
        camera = capture.cameras[index]
        inside = in_pictures(points, [camera])[0]  # (P,)
        columns, rows = camera.project(points[inside])[0].astype(int).T
        held += inside
        shown[inside] += mask[rows, columns] > 0.5
    return shown >= INSIDE * np.maximum(held, 1)
