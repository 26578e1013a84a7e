"""Rigs of known proportions in other rest poses: arms lowered by 45° as MakeHuman's, or spread."""

from functools import cache

import numpy as np

from ico3d.motion.clip import Clip
from ico3d.motion.gestures.library import library
from ico3d.motion.person import person_of
from ico3d.motion.roles import NAMINGS, PARENTS, ROLES, SIDES
from ico3d.rig.rig import Rig

FINGERS = ("thumb", "index", "middle", "ring", "little")
TORSO = {
    "hips": (0, 0.90, 0),
    "spine": (0, 0.98, -0.01),
    "chest": (0, 1.15, 0),
    "neck": (0, 1.42, 0),
    "head": (0, 1.50, 0.02),
}


def rig_of(naming: str, lowered: float = 45.0, bent: float = 0.0, scale: float = 1.0) -> Rig:
    """A person of 1.7 m.

    Args:
        naming: A key of `NAMINGS`.
        lowered: Degrees that the arms are below the horizontal at rest.
        bent: Degrees that the elbows are bent forwards at rest.
        scale: Next to 1.7 m.
    """
    places = {role: np.array(place, float) for role, place in TORSO.items()}
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        places |= _leg(side, sign) | _arm(side, sign, np.radians(lowered), np.radians(bent))
    names: list[str] = []
    parents: list[int] = []
    joints: list[np.ndarray] = []
    last: dict[str, int] = {}
    for number, role in enumerate(ROLES):
        chain = NAMINGS[naming][role]
        parent = last[ROLES[PARENTS[number]]] if PARENTS[number] >= 0 else -1
        child = [r for r, p in zip(ROLES, PARENTS, strict=True) if p == number]
        end = places[child[0]] if child else places[role]
        for i, name in enumerate(chain):
            names.append(name)
            parents.append(parent)
            joints.append(places[role] + i / len(chain) * (end - places[role]))
            parent = len(names) - 1
        last[role] = parent
    return Rig(tuple(names), tuple(parents), scale * np.stack(joints))


@cache
def gestures_of(
    naming: str, lowered: float, bent: float = 0.0, scale: float = 1.0
) -> dict[str, Clip]:
    """All gestures of the package for a person of `rig_of`, made once in a process."""
    return library(person_of(rig_of(naming, lowered, bent, scale)))


def _leg(side: str, sign: float) -> dict[str, np.ndarray]:
    return {
        f"{side}_hip": np.array([0.09 * sign, 0.87, 0.0]),
        f"{side}_knee": np.array([0.11 * sign, 0.48, 0.02]),
        f"{side}_ankle": np.array([0.13 * sign, 0.08, -0.01]),
    }


def _arm(side: str, sign: float, lowered: float, bent: float) -> dict[str, np.ndarray]:
    """An arm with its palm down, or forwards and down where it is lowered."""
    out = np.array([sign * np.cos(lowered), -np.sin(lowered), 0.0])
    ahead = np.array([0.0, 0.0, 1.0])
    fore = np.cos(bent) * out + np.sin(bent) * ahead
    thumbwards = np.cos(bent) * ahead - np.sin(bent) * out
    shoulder = np.array([0.17 * sign, 1.38, 0.0])
    elbow = shoulder + 0.28 * out
    wrist = elbow + 0.25 * fore
    found = {
        f"{side}_clavicle": np.array([0.03 * sign, 1.37, 0.02]),
        f"{side}_shoulder": shoulder,
        f"{side}_elbow": elbow,
        f"{side}_wrist": wrist,
    }
    for row, finger in enumerate(FINGERS):
        base = wrist + (0.03 if finger == "thumb" else 0.09) * fore
        base = base + (0.045 - 0.022 * row) * thumbwards
        for n in (1, 2, 3):
            found[f"{side}_{finger}{n}"] = base + 0.03 * (n - 1) * fore
    return found
