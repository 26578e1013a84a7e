"""Finds clothes and hair: points of a frame's surface that stand off the skin, moved to rest."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from ico3d.body.skinning.template import Skin
from ico3d.capture.capture import Capture
from ico3d.capture.pictures import train_cameras
from ico3d.rig.body_track import BodyTrack
from ico3d.splat.initial import in_pictures

OFF = 0.02
"""Least distance from the skin in metres; a visual hull of 2 cm voxels is not more exact."""
FARTHEST = 0.25
"""Largest distance from the skin in metres of anything that somebody wears."""
INSIDE = 0.95
"""Share of the pictures that hold a point in which the mask must show the person at the point."""


def standing_off(
    skin: Skin,
    track: BodyTrack,
    capture: Capture,
    surface: np.ndarray,
    frame: int,
    others: Sequence[int],
) -> Skin:
    """The points of a frame's surface that stand off the skin, at rest.

    Each is bound to the joints of the nearest point of the skin. A visual hull also fills space
    that no camera can look into, such as under the arms; masks of frames with other poses show that
    such points are not the person's.

    Args:
        skin: Points on the template's skin.
        track: How the person moves.
        capture: The recording, with masks.
        surface: (S, 3) points of the person's surface in the world, such as a visual hull, metres.
        frame: Frame of the surface.
        others: Frames at which the points must lie on the person, too.
    """
    distance, _ = KDTree(skin.posed(track, frame)).query(surface)  # (S,)
    found = skin.pulled_back(surface[(distance > OFF) & (distance < FARTHEST)], track, frame)
    for other in others:
        found = found[_on_person(found.posed(track, other), capture, other)]
    return found


def _on_person(points: np.ndarray, capture: Capture, frame: int) -> np.ndarray:
    """(P,) bool: which points (P, 3) in the world are the person's by the masks of a frame."""
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
