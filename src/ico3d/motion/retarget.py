"""Converts poses by role to rotations of a rig's joints, whatever the rig's rest pose, and back.

A pose by role is (..., R, 4): the local rotation c_r of each role from the *standard pose*, in
which a person stands with hanging arms, palms to the thighs and straight fingers. In the world a
role is rotated by C_r = C_parent · c_r: a bone with direction d in the standard pose has direction
C_r d, in every rig. As a rig's rest pose differs from the standard pose, S_r is the rotation of the
role's joint from rest to the standard pose; so the joint is rotated by C_r · S_r from rest.
"""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.roles import INDEX, PARENTS, ROLES, SIDES, TWIST, Cast, cast
from ico3d.motion.turning import about, across, aligned, arc, power, twist_angle, unit
from ico3d.rig.quaternions import IDENTITY, Array, conjugate, multiply, rotate
from ico3d.rig.rig import Rig, levels

LEVELS = levels(PARENTS)
"""Roles and those above them, from the hips on."""
DOWN = np.array([0.0, -1.0, 0.0])
"""(3,) direction of arms, hands and fingers in the standard pose."""
HINGE = np.array([-1.0, 0.0, 0.0])
"""(3,) axis about which both elbows bend in the standard pose."""
PALM = {"left": np.array([-1.0, 0.0, 0.0]), "right": np.array([1.0, 0.0, 0.0])}
"""(3,) directions in which palms look in the standard pose."""
STRAIGHT = 0.1
"""Sine of an elbow's bend at rest, below which its hinge axis cannot be measured."""
GIRDLE = 0.13
"""Share of the angle by which an arm is lifted at rest that its collarbone has."""


@dataclass(frozen=True, eq=False)
class Retarget:
    """A rig that can be posed by role.

    Attributes:
        cast: Which joints of the rig play which role.
        standard: (R, 4) S_r of each role, wxyz.
        turn: (R,) angle in radians, not 0 for the roles of elbows: the twist of the forearm, beyond
            S_r, that brings the palm to the thigh in the standard pose.
        chains: For each role of the rig, the share of the twist that each of its joints takes, or
            None where joints share the whole rotation evenly.
    """

    cast: Cast
    standard: Array
    turn: Array
    chains: dict[str, tuple[float, ...] | None]

    @property
    def rig(self) -> Rig:
        """The rig that is posed."""
        return self.cast.rig

    def pose(self, by_role: Array) -> Array:
        """Rotations of all joints for a pose by role.

        Args:
            by_role: (..., R, 4) local rotations by role, wxyz.

        Returns:
            (..., J, 4) local rotations of joints for `Rig.posed`. The rotation of a role that the
            rig lacks is added to that of the roles below it.
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
        """(..., R, 4) rotations C_r in the world, from the standard pose, of poses by role."""
        found = np.array(by_role, np.float64)  # (..., R, 4)
        for roles, parents in LEVELS:
            found[..., roles, :] = multiply(found[..., parents, :], found[..., roles, :])
        return found

    def by_role(self, rotations: Array) -> Array:
        """(..., R, 4) pose by role of local rotations (..., J, 4); inverse of `pose`.

        Rotations of joints without a role are added to roles below them. A role that the rig
        lacks has no rotation of its own.
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
        """Sets shoulder and elbow in `world`, as their joints share the twists of arms.

        An upper arm's twist follows from that of its first joint, a forearm's from the hand.
        """
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
        """(..., 4) rotation in the world of a role's first joint, from the standard pose."""
        joint = self.cast.joints[ROLES[number]][0]
        return multiply(turned[..., joint, :], conjugate(self.standard[number]))

    def _turn(self, role: str, by_role: Array, wanted: Array, before: Array, local: Array) -> None:
        """Sets the local rotations of a role's joints.

        Args:
            role: The role.
            by_role: (..., R, 4) pose by role.
            wanted: (..., R, 4) rotations C_r in the world.
            before: (..., 4) rotation in the world of the parent of the role's first joint.
            local: (..., J, 4), changed in place.
        """
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
            local[..., joint, :] = about(self.bone(role, joint), share * angle)

    def bone(self, role: str, joint: int) -> Array:
        """(3,) unit direction at rest from a joint of a role to the next role's first joint."""
        child = ROLES[PARENTS.index(INDEX[role])]
        return unit(self.cast.place(child) - self.rig.joints[joint])


def retarget(rig: Rig) -> Retarget:
    """Prepares a rig to be posed by role.

    Raises:
        SettingsError: If the rig lacks a role that is needed to stand or gesture.
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
    """Sets S_r of the roles of an arm, and the twist of its forearm, from the bones at rest."""
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
    """(3,) direction of a hand at rest, and (3,) direction in which its palm looks."""
    index, middle, little = (
        found.place(f"{side}_{finger}1") for finger in ("index", "middle", "little")
    )
    along = unit(middle - found.place(f"{side}_wrist"))
    sign = 1.0 if side == "right" else -1.0
    return along, sign * np.cross(along, across(little - index, along))


def _hand(found: Cast, side: str, standard: Array) -> None:
    """Sets S_r of the fingers, so that they are straight and parallel.

    Thumbs keep their rest pose relative to the hand.
    """
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
        standard[numbers[2]] = standard[numbers[1]]  # no joint tells where the fingertip is
