"""Finds how near to a baked body its arms can hang, from where its Gaussians are."""

import numpy as np
from numpy.typing import NDArray

from ico3d.bundle.skinned.baked import WEIGHT_UNIT, BakedSkinned
from ico3d.motion.gestures.hanging import hung_at
from ico3d.motion.person import Person
from ico3d.motion.roles import SIDES
from ico3d.motion.standing import stance_of
from ico3d.rig.binding import Binding
from ico3d.rig.quaternions import Array

LIFTS = np.radians(np.arange(2.0, 24.5, 0.5))
"""Angles in radians between hanging arms and the vertical, sideways, that are tried in turn."""
COUNT = 30000
"""Most Gaussians that are looked at, the most important ones."""
CELL = 0.03
"""Height and depth in metres of the cells, seen from aside, in which arm and trunk are compared."""
FEWEST = 5
"""Gaussians of the arm, and of the trunk beside it, that make a cell worth a comparison."""
SURFACE = 0.05
"""Share of a cell's Gaussians that may lie beyond its surface: blurred ones, and strays."""
SIGNS = dict(zip(SIDES, (1.0, -1.0), strict=True))


def hung_beside(baked: BakedSkinned, person: Person) -> Array:
    """(R, 4) pose by role whose arms hang as near to the body as its Gaussians allow.

    Forearms and hands are kept out of the trunk and the thighs of the standing person. Upper arms
    may touch the trunk.

    Args:
        baked: The body.
        person: Measures of its rig.
    """
    shape = _Shape(baked, person)
    poses = hung_at(LIFTS)  # (L, R, 4)
    return next((pose for pose in poses if shape.is_clear(pose)), poses[-1])


class _Shape:
    """Forearms with hands, and the trunk with thighs, as points on a skeleton."""

    def __init__(self, baked: BakedSkinned, person: Person):
        weights = baked.weights[:COUNT] / np.float32(WEIGHT_UNIT)  # (N, 4)
        joints = baked.joints[:COUNT]
        carrier = np.take_along_axis(joints, weights.argmax(1)[:, None], 1)[:, 0]  # (N,)
        self.person, self.stance = person, stance_of(person)
        self.points, self.binding = baked.means[:COUNT], Binding(joints, weights)
        limbs = {side: _hangs_on(person, f"{side}_shoulder", carrier) for side in SIDES}
        self.arms = {side: _hangs_on(person, f"{side}_elbow", carrier) for side in SIDES}
        self.trunk = ~(limbs["left"] | limbs["right"] | _hangs_on(person, "neck", carrier))

    def is_clear(self, by_role: Array) -> bool:
        """Whether forearms and hands are outside of the trunk in a pose by role (R, 4)."""
        root, pose = np.array([0.0, -self.stance.sink, 0.0]), by_role.copy()
        self.stance.place(root, pose)
        matrices = self.person.rig.matrices(self.person.retarget.pose(pose), root)
        points = self.binding.skinned(self.points, matrices)  # (N, 3)
        return all(
            _outside(points[arm] * (sign, 1, 1), points[self.trunk] * (sign, 1, 1))
            for sign, arm in ((SIGNS[side], self.arms[side]) for side in SIDES)
        )


def _hangs_on(person: Person, role: str, carrier: np.ndarray) -> NDArray[np.bool_]:
    """(N,) bool: whether the joints (N,) that carry points are the role's first, or below it."""
    found = {person.cast.joints[role][0]}
    for joint, parent in enumerate(person.rig.parents):
        if parent in found:
            found.add(joint)
    return np.isin(carrier, list(found))


def _outside(arm: Array, trunk: Array) -> bool:
    """Whether an arm (A, 3) lies beside a trunk (T, 3), on the side where x grows."""
    cells = [np.floor(part[:, 1:] / CELL).astype(int) for part in (arm, trunk)]
    for cell in np.unique(cells[0], axis=0):
        inner, outer = (
            part[(own == cell).all(1), 0] for part, own in zip((arm, trunk), cells, strict=True)
        )
        if min(len(inner), len(outer)) < FEWEST:
            continue
        if np.quantile(inner, SURFACE) < np.quantile(outer, 1 - SURFACE):
            return False
    return True
