"""Legs that stand: feet stay where they are, whatever the hips do."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.limbs import Bend, reach
from ico3d.motion.person import Person
from ico3d.motion.roles import INDEX, SIDES
from ico3d.motion.turning import across, aligned, unit
from ico3d.rig.quaternions import Array, conjugate, multiply, rotate

APART = 1.3
"""Metres between the ankles of somebody who stands, next to those between the hips, at most."""
SOFT = 0.995
"""Part of a leg's length between hip and ankle of somebody who stands: knees are not locked."""
KNEE = 0.03
"""Sine of the bend of a knee at rest below which it tells no hinge."""


@dataclass(frozen=True, eq=False)
class Stance:
    """Where somebody's feet stand.

    Attributes:
        person: Who.
        ankles: By side, (3,) metres.
        sink: Metres that the hips are lower than at rest, so that knees are soft.
    """

    person: Person
    ankles: dict[str, Array]
    sink: float

    def place(self, root: Array, by_role: Array) -> None:
        """Sets the legs so that the ankles are in their places and the feet flat.

        Args:
            root: (..., 3) metres that the root moves from rest.
            by_role: (..., R, 4) whose hips are set; the legs are changed in place.
        """
        hips = by_role[..., INDEX["hips"], :]  # (..., 4)
        middle = self.person.place("hips")
        for side in SIDES:
            limb = (f"{side}_hip", f"{side}_knee", f"{side}_ankle")
            start = middle + root + rotate(hips, self.person.place(limb[0]) - middle)
            rest = _at_rest(self.person, limb)
            pole = np.broadcast_to(np.cross(rest.hinge, DOWNWARDS), start.shape) * -1.0
            bend = reach(start, self.ankles[side], self.person.lengths(limb), pole)
            upper = aligned((rest.upper, rest.hinge), (bend.upper, bend.hinge))
            lower = aligned((rest.lower, rest.hinge), (bend.lower, bend.hinge))
            by_role[..., INDEX[limb[0]], :] = multiply(conjugate(hips), upper)
            by_role[..., INDEX[limb[1]], :] = multiply(conjugate(upper), lower)
            by_role[..., INDEX[limb[2]], :] = conjugate(lower)


DOWNWARDS = np.array([0.0, -1.0, 0.0])
LEFTWARDS = np.array([1.0, 0.0, 0.0])


def _at_rest(person: Person, limb: tuple[str, str, str]) -> Bend:
    """How a leg's bones lie at rest; a straight one would bend forwards."""
    hip, knee, ankle = (person.place(role) for role in limb)
    upper, lower = unit(knee - hip), unit(ankle - knee)
    hinge = np.cross(upper, lower)
    if np.linalg.norm(hinge) < KNEE or hinge[0] < 0:
        hinge = LEFTWARDS
    return Bend(upper, lower, across(hinge, unit(ankle - hip)))


def stance_of(person: Person) -> Stance:
    """Feet under the hips, or as near as the rig's rest has them."""
    hips = {side: person.place(f"{side}_hip") for side in SIDES}
    ankles = {side: person.place(f"{side}_ankle").copy() for side in SIDES}
    width = APART * abs(hips["left"][0] - hips["right"][0])
    apart = abs(ankles["left"][0] - ankles["right"][0])
    middle = (ankles["left"][0] + ankles["right"][0]) / 2
    for side in SIDES:
        ankles[side][0] = middle + min(1.0, width / apart) * (ankles[side][0] - middle)
    sinks: list[float] = []
    for side in SIDES:
        limb = (f"{side}_hip", f"{side}_knee", f"{side}_ankle")
        between = hips[side] - ankles[side]
        level = between[0] ** 2 + between[2] ** 2
        tall = np.sqrt((SOFT * sum(person.lengths(limb))) ** 2 - level)
        sinks.append(float(between[1] - tall))
    return Stance(person, ankles, max(sinks))
