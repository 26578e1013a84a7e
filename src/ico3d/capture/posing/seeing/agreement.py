"""Which cameras see the same person, and where that puts each point.

Detectors take left for right, above all from behind, and see people where none are. Every camera
counts twice, as it is and with sides exchanged; cameras that agree with most others are right.
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
"""Points by which cameras agree or do not."""
HANDS = [np.array([NAMES.index(name) for name in hand(side)[1:]]) for side in ("L", "R")]
OTHER = np.array([NAMES.index(opposite(name)) for name in NAMES])
TOLERANCE = 0.06
"""Metres by which half of a camera's core points may miss those of others."""
HAND_TOLERANCE = 0.02
"""Metres by which half of a camera's points of a hand may miss those of others."""
STRAY, HAND_STRAY = 0.015, 0.006
"""Metres by which points of a body, and of a hand, usually stray from where they are."""
WRONG = 0.08
"""Metres by which a sighting misses the others' point when it is of something else."""
LEAST_WEIGHT = 1e-4


@dataclass(frozen=True)
class Placed:
    """What the cameras agree on in one frame.

    Attributes:
        pixels: (C, P, 2) of the cameras, sides put right.
        weights: (C, P); 0 where a camera is wrong or sees nothing.
        points: (P, 3) metres; NaN where fewer than two cameras tell.
    """

    pixels: np.ndarray
    weights: np.ndarray
    points: np.ndarray


def agreed_body(cameras: list[Camera], pixels: np.ndarray, weights: np.ndarray) -> Placed | None:
    """The body that most cameras agree on.

    Args:
        cameras: C cameras.
        pixels: (C, P, 2) of the landmarks.
        weights: (C, P); 0 where nothing is seen.

    Returns:
        What they agree on, or None where no two do.
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
    if (sure * exchanged).sum() > (sure * as_is).sum():  # the whole person the wrong way round
        as_is, exchanged = exchanged, as_is
    fixed, say = pixels.copy(), np.zeros_like(weights)
    for place, camera in enumerate(able):
        if as_is[place]:
            say[camera] = weights[camera]
        elif exchanged[place]:
            fixed[camera], say[camera] = pixels[camera][OTHER], weights[camera][OTHER]
    return placed(cameras, fixed, say, STRAY)


def agreed_hands(cameras: list[Camera], body: Placed) -> Placed:
    """The same with only those sightings of hands on which several cameras agree."""
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
    """Points (N, 3) from pixels (C, N, 2) and weights (C, N); what is far off loses its weight."""
    seen = sightings(cameras, pixels)
    some = np.maximum(weights, LEAST_WEIGHT * 1e-3)
    points, _ = robust(seen, some, stray)
    away = misses(seen, points)  # (C, N)
    kept = np.where(away < WRONG, weights, 0.0)
    told = (kept > LEAST_WEIGHT).sum(0) > 1
    return Placed(pixels, kept, np.where(told[:, None], points, np.nan))
