"""Finds the cameras that see the same person, and triangulates each point from them.

Detectors confuse left and right, above all from behind, and see people where there are none. So
every camera takes part twice, as detected and with sides exchanged; those that agree with most
others are right.
"""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.headpose.triangulation import (
    Sightings,
    agreeing,
    misses,
    robust,
    sightings,
)
from ico3d.capture.posing.model.landmarks import LANDMARKS
from ico3d.capture.posing.model.naming import hand, opposite
from ico3d.common.camera import Camera

NAMES = tuple(LANDMARKS)
CORE = np.array(
    [
        NAMES.index(f"{name}.{side}")
        for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
        for side in ("L", "R")
    ]
)
"""Indices of the landmarks by which it is decided whether cameras agree."""
HANDS = [np.array([NAMES.index(name) for name in hand(side)[1:]]) for side in ("L", "R")]
"""Indices of the landmarks of each hand, without the wrist."""
OTHER = np.array([NAMES.index(opposite(name)) for name in NAMES])
"""(P,) index of the same landmark on the other side."""
TOLERANCE = 0.06
"""Largest median distance in metres of a camera's core points from those of others."""
HAND_TOLERANCE = 0.02
"""Largest median distance in metres of a camera's points of a hand from those of others."""
STRAY, HAND_STRAY = 0.015, 0.006
"""Standard deviation in metres of detected points of a body, and of a hand."""
WRONG = 0.08
"""Distance in metres from the triangulated point from which a sighting is of something else."""
LEAST_WEIGHT = 1e-4
"""Weight above which a camera counts as seeing a point."""


@dataclass(frozen=True)
class Placed:
    """Landmarks in one frame, as C cameras agree on them.

    Attributes:
        pixels: (C, P, 2) pixels of the landmarks, with sides corrected.
        weights: (C, P) weights; 0 where a camera is wrong or does not see the landmark.
        points: (P, 3) triangulated positions in the world, metres; NaN where fewer than two cameras
            see the landmark.
    """

    pixels: np.ndarray
    weights: np.ndarray
    points: np.ndarray


def agreed_body(cameras: list[Camera], pixels: np.ndarray, weights: np.ndarray) -> Placed | None:
    """Finds the body on which most cameras agree.

    Args:
        cameras: C cameras.
        pixels: (C, P, 2) detected pixels of the landmarks.
        weights: (C, P) weights of the detections; 0 where nothing is seen.

    Returns:
        The landmarks; None where no two cameras agree.
    """
    able = np.flatnonzero((weights[:, CORE] > 0).all(1))
    if len(able) < 2:
        return None
    some = [cameras[camera] for camera in able]
    both = np.concatenate([pixels[able], pixels[able][:, OTHER]])  # (2A, P, 2)
    seen = sightings(some + some, both)
    right = agreeing(Sightings(seen.world_to_camera, seen.rays[:, CORE]), TOLERANCE)
    as_is, exchanged = np.split(right, 2)
    if not right.any():
        return None
    sure = weights[able][:, CORE].mean(1)
    if (sure * exchanged).sum() > (sure * as_is).sum():  # the found person has sides exchanged
        as_is, exchanged = exchanged, as_is
    fixed, say = pixels.copy(), np.zeros_like(weights)
    for place, camera in enumerate(able):
        if as_is[place]:
            say[camera] = weights[camera]
        elif exchanged[place]:
            fixed[camera], say[camera] = pixels[camera][OTHER], weights[camera][OTHER]
    return placed(cameras, fixed, say, STRAY)


def agreed_hands(cameras: list[Camera], body: Placed) -> Placed:
    """Landmarks of a body, with hands triangulated only from cameras that agree on them.

    Args:
        cameras: C cameras.
        body: Landmarks of the body, with detections of hands.
    """
    weights, points = body.weights.copy(), body.points.copy()
    for numbers in HANDS:
        able = np.flatnonzero((weights[:, numbers] > 0).all(1))
        fine = np.zeros(len(cameras), bool)
        if len(able) > 1:
            seen = sightings([cameras[c] for c in able], body.pixels[able][:, numbers])
            fine[able[agreeing(seen, HAND_TOLERANCE)]] = True
        weights[np.ix_(~fine, numbers)] = 0
        points[numbers] = np.nan
        found = placed(cameras, body.pixels[:, numbers], weights[:, numbers], HAND_STRAY)
        weights[:, numbers], points[numbers] = found.weights, found.points
    return Placed(body.pixels, weights, points)


def placed(cameras: list[Camera], pixels: np.ndarray, weights: np.ndarray, stray: float) -> Placed:
    """Triangulates points robustly; sightings that are far off get weight 0.

    Args:
        cameras: C cameras.
        pixels: (C, N, 2) pixels of N points.
        weights: (C, N) weights of these sightings.
        stray: Standard deviation of sightings in metres.
    """
    seen = sightings(cameras, pixels)
    some = np.maximum(weights, LEAST_WEIGHT * 1e-3)
    points, _ = robust(seen, some, stray)
    away = misses(seen, points)  # (C, N)
    kept = np.where(away < WRONG, weights, 0.0)
    told = (kept > LEAST_WEIGHT).sum(0) > 1
    return Placed(pixels, kept, np.where(told[:, None], points, np.nan))
