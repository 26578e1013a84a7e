"""Measures a rig's proportions: positions of chin and chest, lengths of arms, thickness."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.retarget import Retarget, retarget
from ico3d.motion.roles import SIDES, Cast
from ico3d.rig.quaternions import Array, rotate
from ico3d.rig.rig import Rig

CHIN = np.array([0.0, -0.073, 0.006])
"""(3,) from between the eyes to the tip of the chin, relative to `Person.height`."""
EYES = np.array([0.0, 0.023, 0.046])
"""(3,) from the head's joint to between the eyes, relative to height; for rigs without eyes."""
CHEST = np.array([0.0, -0.08, 0.10])
"""(3,) from between the shoulders to the skin of the breastbone, relative to height."""
HAND = 0.075
"""Distance from wrist to knuckles, relative to height; for rigs without fingers."""


@dataclass(frozen=True)
class Thickness:
    """Sizes of body parts that hands must not go through, relative to `Person.height`.

    Attributes:
        torso: Half width and half depth of trunk and thighs.
        head: Half width, half height and half depth of the head.
        arm: Radius of forearm and hand.
    """

    torso: tuple[float, float] = (0.128, 0.088)
    head: tuple[float, float, float] = (0.062, 0.083, 0.082)
    arm: float = 0.022


@dataclass(frozen=True, eq=False)
class Person:
    """A rig with its measures, in metres of rest space.

    Attributes:
        retarget: Poses the rig by role.
        height: Height of the head's joint above the ankles; other lengths are relative to it.
        chin: (3,) tip of the chin at rest.
        chest: (3,) skin of the breastbone at rest.
        thickness: Sizes of body parts.
    """

    retarget: Retarget
    height: float
    chin: Array
    chest: Array
    thickness: Thickness = Thickness()

    @property
    def rig(self) -> Rig:
        """The person's skeleton."""
        return self.retarget.rig

    @property
    def cast(self) -> Cast:
        """Which joints of the rig play which role."""
        return self.retarget.cast

    @property
    def eyes(self) -> Array:
        """(3,) point between the eyes at rest, metres."""
        return self.chin - self.height * CHIN

    def place(self, role: str) -> Array:
        """(3,) position of a role's first joint at rest, metres."""
        return self.cast.place(role)

    def lengths(self, limb: tuple[str, str, str]) -> tuple[float, float]:
        """Lengths in metres of the two bones between the three roles of a limb."""
        a, b, c = (self.place(role) for role in limb)
        return float(np.linalg.norm(b - a)), float(np.linalg.norm(c - b))

    def arm(self, side: str) -> float:
        """Length of the straight arm from shoulder to wrist, metres."""
        return sum(self.lengths((f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist")))

    def hand(self, side: str) -> float:
        """Distance from the wrist to the middle finger's knuckle, metres."""
        if not self.cast.has_fingers(side):
            return HAND * self.height
        knuckle = self.place(f"{side}_middle1") - self.place(f"{side}_wrist")
        return float(np.linalg.norm(knuckle))

    def posed(self, by_role: Array, root: Array) -> dict[str, Array]:
        """Positions of each role's first joint in a pose, without footing.

        Args:
            by_role: (..., R, 4) local rotations by role, wxyz.
            root: (..., 3) translation of the root from rest, metres.

        Returns:
            For each role of the rig, (..., 3) metres.
        """
        places = self.rig.posed(self.retarget.pose(by_role), root)[1]
        return {role: places[..., j[0], :] for role, j in self.cast.joints.items()}

    def carried(self, role: str, point: Array, rotations: Array, root: Array) -> Array:
        """(..., 3) position in a pose of a point that is fixed to a role's last joint, metres.

        Args:
            role: Role whose last joint carries the point.
            point: (..., 3) position at rest, metres.
            rotations: (..., J, 4) local rotations of the rig's joints, wxyz.
            root: (..., 3) translation of the root from rest, metres.
        """
        turned, places = self.rig.posed(rotations, root)
        joint = self.cast.joints[role][-1]
        at_rest = self.rig.joints[joint]
        return rotate(turned[..., joint, :], point - at_rest) + places[..., joint, :]


def person_of(rig: Rig) -> Person:
    """Measures a rig.

    Raises:
        SettingsError: If the rig lacks a role that is needed to stand or gesture.
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
