"""A rig's own proportions: where its chin and chest are, how long its arms, how thick its body."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.retarget import Retarget, retarget
from ico3d.motion.roles import SIDES
from ico3d.rig.quaternions import Array, rotate
from ico3d.rig.rig import Rig

CHIN = np.array([0.0, -0.073, 0.006])
"""From between the eyes to the tip of the chin, in heights."""
EYES = np.array([0.0, 0.023, 0.046])
"""From the head's joint to between the eyes, in heights, where a rig has no eyes."""
CHEST = np.array([0.0, -0.08, 0.10])
"""From between the shoulders to the skin of the breastbone, in heights."""
HAND = 0.075
"""From the wrist to the knuckles, in heights, where a rig has no fingers."""


@dataclass(frozen=True)
class Thickness:
    """Half extents in heights of what hands must not go through.

    Attributes:
        torso: Half width and half depth of trunk and thighs.
        head: Half width, half height, half depth.
        arm: Radius of forearm and hand.
    """

    torso: tuple[float, float] = (0.128, 0.088)
    head: tuple[float, float, float] = (0.062, 0.083, 0.082)
    arm: float = 0.022


@dataclass(frozen=True, eq=False)
class Person:
    """A rig and what is measured on it, at rest, in metres of rest space.

    Attributes:
        retarget: Poses the rig by role.
        height: Of the head's joint above the ankles.
        chin: (3,) its tip.
        chest: (3,) the skin of the breastbone.
        thickness: Of its parts.
    """

    retarget: Retarget
    height: float
    chin: Array
    chest: Array
    thickness: Thickness = Thickness()

    @property
    def rig(self) -> Rig:
        """Whose."""
        return self.retarget.rig

    def place(self, role: str) -> Array:
        """(3,) where a role's first joint is at rest."""
        return self.retarget.cast.place(role)

    def lengths(self, limb: tuple[str, str, str]) -> tuple[float, float]:
        """Metres between the three joints of a limb, by role."""
        a, b, c = (self.place(role) for role in limb)
        return float(np.linalg.norm(b - a)), float(np.linalg.norm(c - b))

    def arm(self, side: str) -> float:
        """Metres from shoulder to wrist of a straight arm."""
        return sum(self.lengths((f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist")))

    def hand(self, side: str) -> float:
        """Metres from the wrist to the middle finger's knuckle."""
        if not self.retarget.cast.has_fingers(side):
            return HAND * self.height
        knuckle = self.place(f"{side}_middle1") - self.place(f"{side}_wrist")
        return float(np.linalg.norm(knuckle))

    def posed(self, by_role: Array, root: Array) -> dict[str, Array]:
        """(..., 3) metres in the world where the first joint of each role is."""
        places = self.rig.posed(self.retarget.pose(by_role), root)[1]
        return {role: places[..., j[0], :] for role, j in self.retarget.cast.joints.items()}

    def carried(self, role: str, point: Array, rotations: Array, root: Array) -> Array:
        """(..., 3) where a point (..., 3) of rest space goes that hangs on a role's last joint.

        Args:
            role: Who carries it.
            point: At rest.
            rotations: (..., J, 4) of the rig.
            root: (..., 3) metres that the root moves.
        """
        turned, places = self.rig.posed(rotations, root)
        joint = self.retarget.cast.joints[role][-1]
        at_rest = self.rig.joints[joint]
        return rotate(turned[..., joint, :], point - at_rest) + places[..., joint, :]


def person_of(rig: Rig) -> Person:
    """Measures a rig.

    Raises:
        SettingsError: If it lacks a role without which nobody stands or gestures.
    """
    fitted = retarget(rig)
    cast = fitted.cast
    head = cast.place("head")
    ankles = np.mean([cast.place(f"{side}_ankle") for side in SIDES], axis=0)
    shoulders = np.mean([cast.place(f"{side}_shoulder") for side in SIDES], axis=0)
    height = float(head[1] - ankles[1])
    eyes = cast.eyes()
    if eyes is None:
        eyes = head + height * EYES
    return Person(fitted, height, eyes + height * CHIN, shoulders + height * CHEST)
