"""Shapes of the hand: how its fingers are bent."""

import numpy as np

from ico3d.motion.retarget import PALM
from ico3d.motion.roles import FINGERS, INDEX, PHALANGES
from ico3d.motion.turning import about, unit
from ico3d.rig.quaternions import Array, multiply

CURL = np.array([0.0, 0.0, -1.0])
"""(3,) axis about which the left hand's fingers bend to the palm, in the standard pose."""
SPREAD = PALM["left"]
"""(3,) axis about which the left hand's fingers turn towards the thumb, in the standard pose."""
THUMB = unit(np.array([0.745, -0.66, -0.10]))
"""(3,) axis about which the left thumb bends across the palm, in the standard pose."""
Finger = tuple[float, float, float, float]
"""Degrees by which a finger bends at its three joints, and turns towards the thumb at the first."""

_BENT = (78.0, 92.0, 55.0, 0.0)
_OUT = (4.0, 5.0, 3.0, 0.0)
SHAPES: dict[str, tuple[Finger, Finger, Finger, Finger, Finger]] = {
    "relaxed": (
        (10, 15, 17, -17), (16, 24, 14, 3), (21, 28, 16, 0), (25, 30, 17, -2), (27, 30, 18, -5),
    ),
    "open": ((-10, 2, 4, 0), (3, 8, 6, 6), (5, 10, 6, 0), (7, 11, 7, -5), (9, 12, 8, -11)),
    "offering": (
        (-14, 4, 6, 0), (6, 12, 9, 5), (11, 17, 11, 0), (16, 20, 12, -4), (20, 22, 14, -9),
    ),
    "flat": ((2, 4, 4, 0), (1, 4, 3, 2), (2, 5, 3, 0), (3, 5, 4, -2), (4, 6, 4, -4)),
    "fist": ((22, 38, 32, 0), _BENT, _BENT, _BENT, _BENT),
    "one": ((32, 44, 36, 0), _OUT, _BENT, _BENT, _BENT),
    "point": ((20, 34, 30, 0), _OUT, _BENT, _BENT, _BENT),
    "two": ((26, 40, 34, 0), (*_OUT[:3], 8.0), (*_OUT[:3], -6.0), _BENT, _BENT),
    "three": ((30, 42, 34, 0), (*_OUT[:3], 9.0), _OUT, (*_OUT[:3], -9.0), _BENT),
    "pinch": (
        (20, 26, 22, 0), (44, 40, 22, 3), (30, 30, 18, 0), (24, 26, 16, -3), (20, 22, 15, -7),
    ),
    "chin": ((-2, 8, 14, 0), (12, 20, 12, 4), _BENT, _BENT, _BENT),
    "loose": ((2, 8, 12, 0), (10, 16, 11, 4), (15, 20, 13, 0), (19, 22, 14, -3), (22, 24, 15, -7)),
}  # fmt: skip
"""Shapes by name: thumb, index, middle, ring and little finger."""


def shape(name: str) -> Array:
    """(5, 4) angles of a shape in radians: for each finger, those of `Finger`."""
    return np.radians(np.array(SHAPES[name], float))


def fingers(shapes: Array, by_role: Array) -> None:
    """Bends the fingers of the left hand.

    Args:
        shapes: (..., 5, 4) angles in radians, as from `shape`.
        by_role: (..., R, 4) pose by role, changed in place.
    """
    for row, finger in enumerate(FINGERS):
        axis = THUMB if finger == "thumb" else CURL
        for n in PHALANGES:
            bent = about(axis, shapes[..., row, n - 1])
            if n == 1:
                bent = multiply(about(SPREAD, shapes[..., row, 3]), bent)
            by_role[..., INDEX[f"left_{finger}{n}"], :] = bent
