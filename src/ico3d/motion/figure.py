"""What a page must know of somebody to move their rig by role: measured here, once.

A page has the rig's joints; what follows from them by measuring (`retarget`, `hanging`,
`stance_of`) travels as numbers, so that only the arithmetic of every moment is written twice.
"""

import math
from typing import Any, cast

from ico3d.motion.living import Living
from ico3d.motion.retarget import Retarget
from ico3d.motion.roles import INDEX, ROLES, SIDES
from ico3d.motion.standing import Stance

NEAR = 1e-6
"""Metres, and parts of a quaternion, that figures of one rig may differ by between machines."""


def figure_of(living: Living) -> dict[str, Any]:
    """A person's figure, for JSON.

    Returns:
        `height` metres; `eyes` (3,) metres at rest; `hung` (R, 4); `sink` metres; `parts`: for each
        role that the rig has its `role`, `joints`, `standard` (4,), `turn` radians, `shares` of the
        twist (null where joints share the whole rotation evenly) and, for all joints but the first,
        the `axes` (3,) that they twist about; `hips` (3,) metres at rest; `legs` by side: `hip` at
        rest and `ankle` as it stands (3,), `lengths` (2,) metres, unit directions `upper`, `lower`
        and `hinge` (3,) at rest.
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
    """Whether two figures are of one rig."""
    if isinstance(one, dict) and isinstance(other, dict):
        mine, theirs = cast(dict[str, Any], one), cast(dict[str, Any], other)
        return mine.keys() == theirs.keys() and all(alike(mine[key], theirs[key]) for key in mine)
    if isinstance(one, list) and isinstance(other, list):
        rows, others = cast(list[Any], one), cast(list[Any], other)
        return len(rows) == len(others) and all(map(alike, rows, others))
    if isinstance(one, float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=0, abs_tol=NEAR)
    return one == other
