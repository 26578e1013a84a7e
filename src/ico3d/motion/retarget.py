"""Takes poses by role to a rig, whatever its rest pose, and back.

A pose by role is (..., R, 4): each role's rotation about itself, from the *standard pose*, in which
somebody stands with hanging arms, palms to the thighs, fingers straight. In the world a role is
turned by C_r = C_parent · c_r; the bone that points along d in the standard pose points along
C_r d, in every rig. A rig's rest differs: S_r is the rotation that takes what hangs on the role's
joint from the rig's rest to the standard pose, so that its joint turns by C_r · S_r from rest.
"""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.roles import INDEX, PARENTS, ROLES, SIDES, TWIST, Cast, cast
from ico3d.motion.turning import about, across, aligned, arc, power, twist_angle, unit
from ico3d.rig.quaternions import IDENTITY, Array, conjugate, multiply, rotate
from ico3d.rig.rig import Rig

DOWN = np.array([0.0, -1.0, 0.0])
"""Where arms, hands and fingers point in the standard pose."""
HINGE = np.array([-1.0, 0.0, 0.0])
"""About which elbows bend in the standard pose, both of them."""
PALM = {"left": np.array([-1.0, 0.0, 0.0]), "right": np.array([1.0, 0.0, 0.0])}
"""Where palms look in the standard pose."""
STRAIGHT = 0.1
"""Sine of the bend of an elbow at rest below which its hinge cannot be seen."""
GIRDLE = 0.13
"""Part of an arm's lifting, in the frontal plane, that its collarbone goes along with."""


@dataclass(frozen=True, eq=False)
class Retarget:
    """A rig that can be posed by role.

    Attributes:
        cast: Who plays what.
        standard: (R, 4) S of each role.
        turn: (R,) radians that forearms are turned at the wrist, from their rest with S at the
            elbow, to bring the palm to the thigh.
        chains: For each role its joints with their part of the twist, or None where joints share
            the whole rotation evenly.
    """

    cast: Cast
    standard: Array
    turn: Array
    chains: dict[str, tuple[float, ...] | None]

    @property
    def rig(self) -> Rig:
        """Whose."""
        return self.cast.rig

    def pose(self, by_role: Array) -> Array:
        """Rotations of all joints.

        Args:
            by_role: (..., R, 4).

        Returns:
            (..., J, 4) for `Rig.posed`. A role that the rig lacks moves what its child plays.
        """
        wanted = self.world(by_role)
        plan = {joints[0]: role for role, joints in self.cast.joints.items()}
        local = self.rig.rest(*by_role.shape[:-2])  # (..., J, 4)
        turned = local.copy()  # (..., J, 4) in the world
        for joint, parent in enumerate(self.rig.parents):
            before = turned[..., parent, :] if parent >= 0 else IDENTITY
            if joint in plan:
                self._turn(plan[joint], by_role, wanted, before, local)
            turned[..., joint, :] = multiply(before, local[..., joint, :])
        return local

    def world(self, by_role: Array) -> Array:
        """(..., R, 4) C: how each role is turned in the world from the standard pose."""
        found = np.array(by_role, np.float64)  # (..., R, 4)
        for number, parent in enumerate(PARENTS):
            if parent >= 0:
                found[..., number, :] = multiply(found[..., parent, :], found[..., number, :])
        return found

    def by_role(self, rotations: Array) -> Array:
        """(..., R, 4) of rotations (..., J, 4): what `pose` undoes.

        What joints without a role do is laid upon those below; a role that the rig lacks, and
        legs' twist joints, turn with their parents.
        """
        turned = self.rig.posed(rotations, np.zeros(3))[0]  # (..., J, 4)
        world = np.zeros((*rotations.shape[:-2], len(ROLES), 4))  # (..., R, 4)
        for number, role in enumerate(ROLES):
            parent = PARENTS[number]
            if role in self.cast.joints:
                last = turned[..., self.cast.joints[role][-1], :]
                world[..., number, :] = multiply(last, conjugate(self.standard[number]))
            else:
                world[..., number, :] = world[..., parent, :] if parent >= 0 else IDENTITY
        self._read_twists(turned, world)
        local = world.copy()
        local[..., 1:, :] = multiply(conjugate(world[..., list(PARENTS[1:]), :]), world[..., 1:, :])
        return local

    def _read_twists(self, turned: Array, world: Array) -> None:
        """Twists of arms, which joints share: upper arms tell theirs, hands that of forearms."""
        for side in SIDES:
            shoulder, elbow, wrist = (INDEX[f"{side}_{n}"] for n in ("shoulder", "elbow", "wrist"))
            bare = self._first(turned, shoulder)
            shares = self.chains[ROLES[shoulder]] or (1.0,)
            local = multiply(conjugate(world[..., PARENTS[shoulder], :]), bare)
            more = (1 / shares[0] - 1) * twist_angle(local, DOWN)
            world[..., shoulder, :] = multiply(bare, about(DOWN, more))
            bare = self._first(turned, elbow)
            angle = twist_angle(multiply(conjugate(bare), world[..., wrist, :]), DOWN)
            world[..., elbow, :] = multiply(bare, about(DOWN, angle))

    def _first(self, turned: Array, number: int) -> Array:
        """(..., 4) how a role's first joint is turned from the standard pose."""
        joint = self.cast.joints[ROLES[number]][0]
        return multiply(turned[..., joint, :], conjugate(self.standard[number]))

    def _turn(self, role: str, by_role: Array, wanted: Array, before: Array, local: Array) -> None:
        """Sets the rotations of a role's joints; the first one's parent is turned by `before`."""
        number, joints = INDEX[role], self.cast.joints[role]
        shares = self.chains[role]
        if shares is None:
            whole = multiply(wanted[..., number, :], self.standard[number])
            part = power(multiply(conjugate(before), whole), 1 / len(joints))
            local[..., list(joints), :] = part[..., None, :]
            return
        angle = twist_angle(by_role[..., number, :], DOWN)  # (...)
        swing = multiply(wanted[..., number, :], about(DOWN, -angle))
        angle = angle + self.turn[number]
        first = multiply(swing, about(DOWN, shares[0] * angle))
        local[..., joints[0], :] = multiply(
            conjugate(before), multiply(first, self.standard[number])
        )
        for joint, share in zip(joints[1:], shares[1:], strict=True):
            local[..., joint, :] = about(self._bone(role, joint), share * angle)

    def _bone(self, role: str, joint: int) -> Array:
        """(3,) direction at rest from a joint to where the role below begins."""
        child = ROLES[PARENTS.index(INDEX[role])]
        return unit(self.cast.place(child) - self.rig.joints[joint])


def retarget(rig: Rig) -> Retarget:
    """Prepares a rig to be posed by role.

    Raises:
        SettingsError: If the rig lacks a role without which nobody stands or gestures.
    """
    found = cast(rig)
    standard = np.tile(IDENTITY, (len(ROLES), 1))  # (R, 4)
    turn = np.zeros(len(ROLES))
    for side in SIDES:
        _arm(found, side, standard, turn)
        _hand(found, side, standard)
    chains: dict[str, tuple[float, ...] | None] = {}
    for role, joints in found.joints.items():
        shares = TWIST[found.naming].get(role.partition("_")[2])
        chains[role] = shares[: len(joints)] if shares else None
    return Retarget(found, standard, turn, chains)


def _arm(found: Cast, side: str, standard: Array, turn: Array) -> None:
    """S of an arm, from its bones."""
    clavicle, shoulder, elbow, wrist = (
        INDEX[f"{side}_{part}"] for part in ("clavicle", "shoulder", "elbow", "wrist")
    )
    a, b, c = (found.place(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
    upper, lower = unit(b - a), unit(c - b)
    bend = np.cross(upper, lower)
    lifted = np.arctan2(upper[0], -upper[1])  # radians in the frontal plane; left ones are positive
    standard[clavicle] = about(np.array([0.0, 0.0, 1.0]), -GIRDLE * lifted)
    if np.linalg.norm(bend) > STRAIGHT:
        hinge = unit(bend)
        standard[shoulder] = aligned((upper, hinge), (DOWN, HINGE))
        standard[elbow] = aligned((lower, hinge), (DOWN, HINGE))
    else:
        standard[shoulder] = arc(upper, DOWN)
        along = rotate(standard[shoulder], lower)
        standard[elbow] = multiply(arc(along, DOWN), standard[shoulder])
    standard[wrist] = standard[elbow]
    if found.has_fingers(side):
        standard[wrist] = aligned(_palm(found, side), (DOWN, PALM[side]))
        off = multiply(standard[wrist], conjugate(standard[elbow]))
        turn[elbow] = twist_angle(off, DOWN)


def _palm(found: Cast, side: str) -> tuple[Array, Array]:
    """(3,) direction of a hand at rest, and (3,) where its palm looks."""
    index, middle, little = (
        found.place(f"{side}_{finger}1") for finger in ("index", "middle", "little")
    )
    along = unit(middle - found.place(f"{side}_wrist"))
    sign = 1.0 if side == "right" else -1.0
    return along, sign * np.cross(along, across(little - index, along))


def _hand(found: Cast, side: str, standard: Array) -> None:
    """S of the fingers: straight beside one another; thumbs stay as they are on the hand."""
    wrist = standard[INDEX[f"{side}_wrist"]]
    palm = PALM[side]
    for finger in ("thumb", "index", "middle", "ring", "little"):
        numbers = [INDEX[f"{side}_{finger}{n}"] for n in (1, 2, 3)]
        standard[numbers] = wrist
        knuckles = [f"{side}_{finger}{n}" for n in (1, 2, 3)]
        if finger == "thumb" or not set(knuckles) <= set(found.joints):
            continue
        places = [found.place(role) for role in knuckles]
        for first, second, number in zip(places, places[1:], numbers, strict=False):
            along = rotate(wrist, unit(second - first))
            standard[number] = multiply(aligned((along, across(palm, along)), (DOWN, palm)), wrist)
        standard[numbers[2]] = standard[numbers[1]]  # where its tip is no joint tells
