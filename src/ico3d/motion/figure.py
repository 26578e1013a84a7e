"""A person's figure: measures that a page needs to pose the person's rig by role.

A page knows the rig's joints. What `retarget`, `hanging` and `stance_of` measure on them is sent as
numbers, so that only the computation of poses has to be written twice, in Python and TypeScript.
"""

import math
from typing import Any, cast

from ico3d.motion.living import Living
from ico3d.motion.retarget import Retarget
from ico3d.motion.roles import INDEX, ROLES, SIDES
from ico3d.motion.standing import Stance

NEAR = 1e-6
"""Largest difference of numbers, such as metres, between figures of one rig on two machines."""


def figure_of(living: Living) -> dict[str, Any]:
    """A person's figure as values for JSON.

    Returns:
        - `height`: `Person.height`, metres;
        - `eyes`: (3,) point between the eyes at rest, metres;
        - `hung`: (R, 4) pose by role with hanging arms;
        - `sink`: `Stance.sink`, metres;
        - `parts`: for each role of the rig its name `role`, the indices of its `joints`, `standard`
          (4,), `turn` in radians, `shares` of the twist (null where joints share the whole rotation
          evenly), and `axes` (3,) about which joints after the first one twist;
        - `hips`: (3,) joint of the hips at rest, metres;
        - `legs`: by side, `hip` (3,) at rest and `ankle` (3,) where the person stands, metres,
          `lengths` (2,) of the bones, and unit vectors `upper`, `lower` and `hinge` (3,) at rest.
    """
    person, stance = living.person, living.stance
    return {
        "height": person.height,
        "eyes": person.eyes.tolist(),
        "hung": living.hung.tolist(),
        "sink": stance.sink,
        "parts": [_part(person.retarget, role) for role in ROLES if role in person.cast.joints],
        "hips": person.place("hips").tolist(),
        "legs": {side: _leg(stance, side) for side in SIDES},
    }


def _part(retarget: Retarget, role: str) -> dict[str, Any]:
    number, joints = INDEX[role], retarget.cast.joints[role]
    shares = retarget.chains[role]
    return {
        "role": role,
        "joints": list(joints),
        "standard": retarget.standard[number].tolist(),
        "turn": float(retarget.turn[number]),
        "shares": list(shares) if shares else None,
        "axes": [retarget.bone(role, joint).tolist() for joint in joints[1:]] if shares else [],
    }


def _leg(stance: Stance, side: str) -> dict[str, Any]:
    leg = stance.leg(side)
    return {
        "hip": stance.person.place(leg.limb[0]).tolist(),
        "ankle": stance.ankles[side].tolist(),
        "lengths": list(leg.lengths),
        "upper": leg.rest.upper.tolist(),
        "lower": leg.rest.lower.tolist(),
        "hinge": leg.rest.hinge.tolist(),
    }


def alike(one: Any, other: Any) -> bool:
    """Whether two figures are of the same rig: equal but for rounding (`NEAR`)."""
    if isinstance(one, dict) and isinstance(other, dict):
        mine, theirs = cast(dict[str, Any], one), cast(dict[str, Any], other)
        return mine.keys() == theirs.keys() and all(alike(mine[key], theirs[key]) for key in mine)
    if isinstance(one, list) and isinstance(other, list):
        rows, others = cast(list[Any], one), cast(list[Any], other)
        return len(rows) == len(others) and all(map(alike, rows, others))
    if isinstance(one, float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=0, abs_tol=NEAR)
    return one == other
