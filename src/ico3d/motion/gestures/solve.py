"""Turns a script into poses by role for one person, by inverse kinematics of torso and arms."""

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
"""Samples of a gesture per second."""
LIFT = np.radians(24.0)
"""Largest angle in radians by which a collarbone is lifted, with the hand above the head."""
TIPS = 1.9
"""Length of a hand with straight fingers, relative to the distance from wrist to knuckles."""
PUSHES = 4
"""Number of iterations in which hands are pushed out of the body."""
SHARED = {"spine": 0.4, "chest": 0.6, "neck": 0.5, "head": 0.5}
"""Share of a role in the rotation of the torso (spine, chest) or of the head (neck, head)."""


def eased(part: Array) -> Array:
    """Minimum-jerk interpolation: from 0 to 1, with speed and acceleration 0 at both ends."""
    part = np.clip(part, 0.0, 1.0)
    return part**3 * (10 - 15 * part + 6 * part**2)


def between(keys: Array, times: Array) -> tuple[Index, Index, Array]:
    """Finds the keys about some times.

    Args:
        keys: (K,) times of the keys, ascending, seconds.
        times: (F,) seconds.

    Returns:
        (F,) index of the key before and (F,) of the key after each time, and (F,) minimum-jerk
        weight of the key after.
    """
    after = np.clip(np.searchsorted(keys, times, side="right"), 1, len(keys) - 1)
    span = np.maximum(keys[after] - keys[after - 1], 1e-9)
    return after - 1, after, eased((times - keys[after - 1]) / span)


@dataclass(frozen=True, eq=False)
class _Arm:
    """Goals of an arm in F samples, in rest space as it moves with the chest.

    Attributes:
        wrist: (F, 3) positions of the wrist, metres.
        elbow: (F, 3) directions in which the elbow points.
        hand: (F, 4) rotations of the hand from the standard pose, wxyz.
        shapes: (F, 5, 4) angles of the fingers, as from `shape`; for either hand.
    """

    wrist: Array
    elbow: Array
    hand: Array
    shapes: Array


def solve(person: Person, script: Script, hung: Array) -> tuple[Array, tuple[str, ...]]:
    """Poses of a gesture.

    Args:
        person: Who makes the gesture.
        script: The gesture.
        hung: (R, 4) pose by role with hanging arms (`hanging`).

    Returns:
        (F, R, 4) poses by role, `RATE` per second from 0 to the script's end, and the names of the
        roles that the gesture moves; other roles are as in `hung`.
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
    """Rotates torso and head and lifts collarbones in `poses` (F, R, 4); returns moved roles."""
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
    """Moves an arm by its keys in `poses` (F, R, 4), in place; returns the moved roles."""
    arm = _interpolated(person, side, keys, times, poses, hung)
    chest = person.retarget.world(poses)[:, INDEX["chest"]]  # (F, 4)
    lift = _lift(person, side, arm.wrist)
    collar = INDEX[f"{side}_clavicle"]
    poses[:, collar] = multiply(poses[:, collar], lift)
    rotations = person.retarget.pose(poses)
    places = person.rig.posed(rotations, np.zeros(3))[1]  # (F, J, 3)
    shoulder = places[:, person.cast.joints[f"{side}_shoulder"][0]]  # (F, 3)
    wrist = _pushed(person, side, arm, rotations)
    target = person.carried("chest", wrist, rotations, np.zeros(3))
    limb = (f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist")
    bend = reach(shoulder, target, person.lengths(limb), rotate(chest, arm.elbow))
    upper = aligned((DOWN, HINGE), (bend.upper, bend.hinge))  # (F, 4) in the world
    bare = aligned((DOWN, HINGE), (bend.lower, bend.hinge))  # (F, 4) the forearm without twist
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
    """Goals of an arm at times (F,), by minimum-jerk movements between its keys."""
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
    """(..., 3) tip of the chin in poses (..., R, 4), in rest space as it moves with the chest."""
    rotations = person.retarget.pose(poses)
    chin = person.carried("head", person.chin, rotations, np.zeros(3))
    origin = person.carried("chest", np.zeros(3), rotations, np.zeros(3))
    chest = person.retarget.world(poses)[..., INDEX["chest"], :]
    return rotate(conjugate(chest), chin - origin)


def _at(person: Person, side: str, at: Reach, chin: Array) -> tuple[Array, Array, Array, Array]:
    """Goals of an arm for a `Reach`: a row each of wrist, elbow, hand and shapes of `_Arm`."""
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
    """Goals of a hanging arm: a row each of wrist, elbow, hand and shapes of `_Arm`."""
    places = person.posed(hung, np.zeros(3))
    start, middle, end = (places[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist"))
    elbow = across(middle - start, unit(end - start))
    hand = person.retarget.world(hung)[INDEX[f"{side}_wrist"]]
    return end, elbow, hand, shape("relaxed")


def _lift(person: Person, side: str, wrist: Array) -> Array:
    """(F, 4) rotation of the collarbone, which is lifted with the wrist (F, 3)."""
    above = (wrist - person.place(f"{side}_shoulder"))[:, 1] / person.arm(side)
    sign = 1.0 if side == "left" else -1.0
    return about(np.array([0.0, 0.0, 1.0]), sign * LIFT * eased((above + 0.75) / 1.5))


def _pushed(person: Person, side: str, arm: _Arm, rotations: Array) -> Array:
    """(F, 3) positions of the wrist, moved so that hand and forearm are outside trunk and head."""
    wrist: Array = arm.wrist.copy()
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
            wrist = _way_out(person, wrist, point, thick)
    return wrist


def _way_out(person: Person, wrist: Array, point: Array, thick: float) -> Array:
    """(F, 3) positions of the wrist moved by the way of a point out of trunk and head."""
    out = way_out_of_trunk(person, point, thick)
    return wrist + out + way_out_of_head(person, point + out, thick)
