"""From a script to rotations by role, for one person: inverse kinematics of torso and arms."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ico3d.motion.clearance import way_out_of_head, way_out_of_trunk
from ico3d.motion.gestures.script import Lean, Reach, Script
from ico3d.motion.gestures.shapes import fingers, shape
from ico3d.motion.limbs import reach
from ico3d.motion.person import Person
from ico3d.motion.retarget import DOWN, HINGE, PALM
from ico3d.motion.roles import INDEX, MIRROR, ROLES, SIDES, arm_roles
from ico3d.motion.turning import about, across, aligned, mirrored, power, twist_angle, unit
from ico3d.rig.quaternions import (
    IDENTITY,
    Array,
    conjugate,
    continuous,
    from_rotvec,
    multiply,
    rotate,
    slerp,
)

Index = NDArray[np.integer]
RATE = 60.0
"""Samples per second."""
LIFT = np.radians(24.0)
"""How far a collarbone lifts with the hand above the head."""
TIPS = 1.9
"""Length of a hand with straight fingers, next to that from the wrist to the knuckles."""
PUSHES = 4
"""How often hands are pushed out of the body: each time by what is left."""
SHARED = {"spine": 0.4, "chest": 0.6, "neck": 0.5, "head": 0.5}
"""Part that a role takes of the turn of torso, or head."""


def eased(part: Array) -> Array:
    """Minimum jerk: 0 … 1 without speed or acceleration at either end."""
    part = np.clip(part, 0.0, 1.0)
    return part**3 * (10 - 15 * part + 6 * part**2)


def between(keys: Array, times: Array) -> tuple[Index, Index, Array]:
    """The keys (K,) before and after (F,) seconds, and (F,) how far it is between them."""
    after = np.clip(np.searchsorted(keys, times, side="right"), 1, len(keys) - 1)
    span = np.maximum(keys[after] - keys[after - 1], 1e-9)
    return after - 1, after, eased((times - keys[after - 1]) / span)


@dataclass(frozen=True, eq=False)
class _Arm:
    """What an arm is to do in F samples; directions in the chest's axes.

    Attributes:
        wrist: (F, 3) metres in rest space, as the chest carries it.
        elbow: (F, 3) where it points.
        hand: (F, 4) from the standard pose.
        shapes: (F, 5, 4) of the left hand, or of the right one seen in a mirror.
    """

    wrist: Array
    elbow: Array
    hand: Array
    shapes: Array


def solve(person: Person, script: Script, hung: Array) -> tuple[Array, tuple[str, ...]]:
    """Poses of a gesture.

    Args:
        person: Who makes it.
        script: What is to be done.
        hung: (R, 4) by role, of the person with hanging arms (`hanging`).

    Returns:
        (F, R, 4) by role at `RATE` from 0 to the script's end, and the names of the roles that it
        moves; the others are as in the standard pose with hanging arms.
    """
    times = np.arange(round(script.end * RATE) + 1) / RATE
    poses = np.tile(hung, (len(times), 1, 1))  # (F, R, 4)
    moved: list[str] = []
    if script.lean:
        moved += _lean(script.lean, times, poses)
    for side, keys in zip(SIDES, (script.left, script.right), strict=True):
        if keys:
            moved += _gesture(person, side, keys, times, poses, hung)
    there = person.retarget.cast.joints
    return poses, tuple(role for role in ROLES if role in moved and role in there)


def _lean(keys: tuple[tuple[float, Lean], ...], times: Array, poses: Array) -> list[str]:
    """Turns torso and head, and lifts collarbones."""
    rows = np.array([[*lean.chest, *lean.head, lean.shrug] for _, lean in keys])  # (K, 7)
    before, after, part = between(np.array([seconds for seconds, _ in keys]), times)
    now = np.radians(rows[before] + part[:, None] * (rows[after] - rows[before]))  # (F, 7)
    moved: list[str] = []
    for roles, columns in ((("spine", "chest"), now[:, :3]), (("neck", "head"), now[:, 3:6])):
        if np.any(columns):
            whole = from_rotvec(columns)
            for role in roles:
                poses[:, INDEX[role]] = power(whole, SHARED[role])
            moved += roles
    if np.any(now[:, 6]):
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            lifted = about(np.array([0.0, 0.0, 1.0]), sign * now[:, 6])
            poses[:, INDEX[f"{side}_clavicle"]] = lifted
            moved.append(f"{side}_clavicle")
    return moved


def _gesture(
    person: Person,
    side: str,
    keys: tuple[tuple[float, Reach | None], ...],
    times: Array,
    poses: Array,
    hung: Array,
) -> list[str]:
    """Moves an arm as its keys say."""
    arm = _interpolated(person, side, keys, times, poses, hung)
    chest = person.retarget.world(poses)[:, INDEX["chest"]]  # (F, 4)
    lift = _lift(person, side, arm.wrist)
    collar = INDEX[f"{side}_clavicle"]
    poses[:, collar] = multiply(poses[:, collar], lift)
    rotations = person.retarget.pose(poses)
    shoulder = person.posed(poses, np.zeros(3))[f"{side}_shoulder"]  # (F, 3)
    wrist = _pushed(person, side, arm, rotations)
    target = person.carried("chest", wrist, rotations, np.zeros(3))
    limb = (f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist")
    bend = reach(shoulder, target, person.lengths(limb), rotate(chest, arm.elbow))
    upper = aligned((DOWN, HINGE), (bend.upper, bend.hinge))  # (F, 4) in the world
    bare = aligned((DOWN, HINGE), (bend.lower, bend.hinge))
    hand = multiply(chest, arm.hand)
    angle = np.unwrap(twist_angle(multiply(conjugate(bare), hand), DOWN))
    lower = multiply(bare, about(DOWN, angle))
    girdle = person.retarget.world(poses)[:, collar]
    poses[:, INDEX[limb[0]]] = continuous(multiply(conjugate(girdle), upper))
    poses[:, INDEX[limb[1]]] = continuous(multiply(conjugate(upper), lower))
    poses[:, INDEX[limb[2]]] = continuous(multiply(conjugate(lower), hand))
    _bend_fingers(side, arm.shapes, poses)
    return list(arm_roles(side))


def _bend_fingers(side: str, shapes: Array, poses: Array) -> None:
    made = np.tile(IDENTITY, (*poses.shape[:-1], 1))  # (F, R, 4)
    fingers(shapes, made)
    if side == "right":
        made = mirrored(made[:, MIRROR])
    own = [INDEX[r] for r in ROLES if r.startswith(f"{side}_") and r[-1].isdigit()]
    poses[:, own] = made[:, own]


def _interpolated(
    person: Person,
    side: str,
    keys: tuple[tuple[float, Reach | None], ...],
    times: Array,
    poses: Array,
    hung: Array,
) -> _Arm:
    """Minimum-jerk movements between the keys of one hand."""
    seconds = np.array([time for time, _ in keys])
    before, after, part = between(seconds, times)
    chins = _chins(person, poses[np.searchsorted(times, seconds - 0.5 / RATE)])  # (K, 3)
    hanging = _hung(person, side, hung)
    rows = [
        hanging if at is None else _at(person, side, at, chin)
        for (_, at), chin in zip(keys, chins, strict=True)
    ]

    def mixed(values: Array) -> Array:
        along = part.reshape(-1, *[1] * (values.ndim - 1))
        return values[before] + along * (values[after] - values[before])

    wrist, elbow, hand, shapes = (np.stack([row[i] for row in rows]) for i in range(4))
    return _Arm(mixed(wrist), mixed(elbow), slerp(hand[before], hand[after], part), mixed(shapes))


def _chins(person: Person, poses: Array) -> Array:
    """(..., 3) where the head has its chin, in rest space as the chest carries it."""
    rotations = person.retarget.pose(poses)
    chin = person.carried("head", person.chin, rotations, np.zeros(3))
    origin = person.carried("chest", np.zeros(3), rotations, np.zeros(3))
    chest = person.retarget.world(poses)[..., INDEX["chest"], :]
    return rotate(conjugate(chest), chin - origin)


def _at(person: Person, side: str, at: Reach, chin: Array) -> tuple[Array, Array, Array, Array]:
    """Wrist, elbow, hand and fingers of a place, in the chest's axes."""
    outwards = np.array([1.0 if side == "left" else -1.0, 1.0, 1.0])
    along = unit(outwards * at.fingers)
    palm = across(outwards * at.palm, along)
    shoulder = person.place(f"{side}_shoulder")
    anchors = {"shoulder": shoulder, "chest": person.chest, "chin": chin}
    there = anchors[at.anchor] + person.arm(side) * outwards * np.array(at.place)
    length = person.hand(side)
    beyond = min(at.part, 1.0) + (TIPS - 1) * max(at.part - 1, 0.0)
    wrist = there - beyond * length * along
    hand = aligned((DOWN, PALM[side]), (along, palm))
    return wrist, unit(outwards * at.elbow), hand, shape(at.shape)


def _hung(person: Person, side: str, hung: Array) -> tuple[Array, Array, Array, Array]:
    """The same of an arm that hangs."""
    places = person.posed(hung, np.zeros(3))
    start, middle, end = (places[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist"))
    elbow = across(middle - start, unit(end - start))
    hand = person.retarget.world(hung)[INDEX[f"{side}_wrist"]]
    return end, elbow, hand, shape("relaxed")


def _lift(person: Person, side: str, wrist: Array) -> Array:
    """(F, 4) of the collarbone, which rises with the hand."""
    above = (wrist - person.place(f"{side}_shoulder"))[:, 1] / person.arm(side)
    sign = 1.0 if side == "left" else -1.0
    return about(np.array([0.0, 0.0, 1.0]), sign * LIFT * eased((above + 0.75) / 1.5))


def _pushed(person: Person, side: str, arm: _Arm, rotations: Array) -> Array:
    """(F, 3) wrists such that neither hand nor forearm is inside trunk or head."""
    wrist = arm.wrist.copy()
    along = rotate(arm.hand, DOWN)  # (F, 3) in the chest's axes
    length, radius = person.hand(side), person.thickness.arm * person.height
    shoulder = person.place(f"{side}_shoulder")
    lengths = person.lengths((f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"))
    for _ in range(PUSHES):
        bend = reach(shoulder, wrist, lengths, arm.elbow)
        elbow = wrist - lengths[1] * bend.lower
        for point, thick in (
            (0.5 * (wrist + elbow), radius),
            (wrist, radius),
            (wrist + length * along, 0.7 * radius),
            (wrist + TIPS * length * along, 0.2 * radius),
        ):
            out = way_out_of_trunk(person, point, thick)
            wrist = wrist + out + way_out_of_head(person, point + out, thick)
    return wrist
