"""Poses legs so that feet stay in place, whatever the hips do."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.limbs import Bend, reach
from ico3d.motion.person import Person
from ico3d.motion.roles import INDEX, SIDES
from ico3d.motion.turning import across, aligned, unit
from ico3d.rig.quaternions import Array, conjugate, multiply, rotate

APART, APART_BEFORE = 0.95, 1.3
"""Largest distance between the ankles of a standing person, relative to that between the hips, and
what it was in files of earlier versions."""
SOFT = 0.995
"""Distance from hip to ankle of a standing person, relative to the leg's length; knees are soft."""
KNEE = 0.03
"""Sine of a knee's bend at rest, below which its hinge axis cannot be measured."""


@dataclass(frozen=True, eq=False)
class Leg:
    """A leg at rest.

    Attributes:
        limb: Roles of hip, knee and ankle.
        lengths: Lengths of the two bones, metres.
        rest: Directions of the two bones.
    """

    limb: tuple[str, str, str]
    lengths: tuple[float, float]
    rest: Bend


@dataclass(frozen=True, eq=False)
class Stance:
    """Where a person's feet stand.

    Attributes:
        person: Who stands.
        ankles: (3,) position of each side's ankle, metres in rest space.
        sink: How far the hips are lowered from rest, metres, so that knees are soft.
    """

    person: Person
    ankles: dict[str, Array]
    sink: float

    def place(self, root: Array, by_role: Array) -> None:
        """Poses the legs so that ankles are in their places and feet are flat on the ground.

        Args:
            root: (..., 3) translation of the root from rest, metres.
            by_role: (..., R, 4) pose by role with the rotation of the hips; the roles of the legs
                are set in place.
        """
        hips = by_role[..., INDEX["hips"], :]  # (..., 4)
        middle = self.person.place("hips")
        for side in SIDES:
            leg = self.leg(side)
            limb, rest = leg.limb, leg.rest
            start = middle + root + rotate(hips, self.person.place(limb[0]) - middle)
            pole = np.broadcast_to(np.cross(rest.hinge, DOWNWARDS), start.shape) * -1.0
            bend = reach(start, self.ankles[side], leg.lengths, pole)
            upper = aligned((rest.upper, rest.hinge), (bend.upper, bend.hinge))
            lower = aligned((rest.lower, rest.hinge), (bend.lower, bend.hinge))
            by_role[..., INDEX[limb[0]], :] = multiply(conjugate(hips), upper)
            by_role[..., INDEX[limb[1]], :] = multiply(conjugate(upper), lower)
            by_role[..., INDEX[limb[2]], :] = conjugate(lower)

    def leg(self, side: str) -> Leg:
        """Measures of the leg on a side."""
        limb = (f"{side}_hip", f"{side}_knee", f"{side}_ankle")
        return Leg(limb, self.person.lengths(limb), _at_rest(self.person, limb))


DOWNWARDS = np.array([0.0, -1.0, 0.0])
LEFTWARDS = np.array([1.0, 0.0, 0.0])


def _at_rest(person: Person, limb: tuple[str, str, str]) -> Bend:
    """Directions of a leg's bones at rest; the hinge of a straight leg bends the knee forwards."""
    hip, knee, ankle = (person.place(role) for role in limb)
    upper, lower = unit(knee - hip), unit(ankle - knee)
    hinge = np.cross(upper, lower)
    if np.linalg.norm(hinge) < KNEE or hinge[0] < 0:
        hinge = LEFTWARDS
    return Bend(upper, lower, across(hinge, unit(ankle - hip)))


def stance_of(person: Person, apart: float = APART) -> Stance:
    """A stance with feet at their rest positions, moved together if they are too far apart.

    Args:
        person: Who stands.
        apart: Largest distance between the ankles, relative to that between the hips.
    """
    hips = {side: person.place(f"{side}_hip") for side in SIDES}
    ankles: dict[str, Array] = {side: person.place(f"{side}_ankle").copy() for side in SIDES}
    width = apart * abs(hips["left"][0] - hips["right"][0])
    at_rest = abs(ankles["left"][0] - ankles["right"][0])
    middle = (ankles["left"][0] + ankles["right"][0]) / 2
    for side in SIDES:
        ankles[side][0] = middle + min(1.0, width / at_rest) * (ankles[side][0] - middle)
    sinks: list[float] = []
    for side in SIDES:
        limb = (f"{side}_hip", f"{side}_knee", f"{side}_ankle")
        between = hips[side] - ankles[side]
        level = between[0] ** 2 + between[2] ** 2
        tall = np.sqrt((SOFT * sum(person.lengths(limb))) ** 2 - level)
        sinks.append(float(between[1] - tall))
    return Stance(person, ankles, max(sinks))
