"""Turns goals for hands, feet and torso into rotations of all joints."""

from dataclasses import dataclass

import numpy as np

from ico3d.studio.acting.limbs import Limb, reach, split_twist, unit
from ico3d.studio.person.skeleton import Skeleton, about, turned

SIDES = ("L", "R")
SPINE = ("spine05", "spine04", "spine03", "spine02", "spine01")
NECK = ("neck01", "neck02", "neck03", "head")
FINGERS = ("finger2", "finger3", "finger4", "finger5")
LIFTED = np.radians((-6.0, 26.0))
"""Rotation of the shoulder girdle in radians: with the hand down, and with it above the head."""
UPPER_TWIST = 0.5
"""Share of the upper arm's twist that goes to the first of its two bones."""
GATHERED = 0.7
"""Share of the fingers' spread at rest that is undone."""
THUMB_CURL = 0.35
"""Bend of the thumb's joints, as a factor of that of the fingers' joints."""


@dataclass(frozen=True)
class Acting:
    """What a body does in F frames; where there are two rows, they are the person's left and right.

    Attributes:
        shift: (F, 3) displacement of the pelvis from its rest position, metres.
        pelvis: (F, 3) turn of the pelvis about X, Y, Z, radians.
        chest: (F, 3) turn of the chest relative to the pelvis about X, Y, Z, radians.
        head: (F, 3) turn of the head relative to the chest about X, Y, Z, radians.
        wrists: (2, F, 3) wrists relative to the shoulders at rest, in the chest's axes, metres.
        elbows: (2, F, 3) directions in which elbows point, in the chest's axes.
        palms: (2, F) rotation of the forearm that turns the palm upwards, radians.
        flexed: (2, F) bend of the wrist towards the palm, radians.
        curled: (2, F) bend of each finger joint, radians.
        ankles: (2, F, 3) ankles in canonical head space, metres.
        tiptoe: (2, F) angle by which the toes point down, radians.
        toes_out: (2,) angle by which the feet turn outwards, radians.
    """

    shift: np.ndarray
    pelvis: np.ndarray
    chest: np.ndarray
    head: np.ndarray
    wrists: np.ndarray
    elbows: np.ndarray
    palms: np.ndarray
    flexed: np.ndarray
    curled: np.ndarray
    ankles: np.ndarray
    tiptoe: np.ndarray
    toes_out: np.ndarray


def pose(skeleton: Skeleton, acting: Acting) -> np.ndarray:
    """The joints' transforms of a body that acts.

    Returns:
        (F, J, 4, 4) float64 transforms from the rest pose to the posed body, both in canonical head
        space at rest.
    """
    frames, joints = len(acting.shift), len(skeleton.names)
    rotations = np.tile(np.eye(3), (frames, joints, 1, 1))  # (F, J, 3, 3)
    rotations[:, 0] = turned(acting.pelvis)
    for names, turns in ((SPINE, acting.chest), (NECK, acting.head)):
        for name in names:
            rotations[:, skeleton.index(name)] = turned(turns / len(names))
    _lift_shoulders(skeleton, acting, rotations)
    world = skeleton.matrices(rotations, acting.shift)
    for side in range(2):
        _place_arm(skeleton, acting, rotations, world, side)
        _place_leg(skeleton, acting, rotations, world, side)
    return skeleton.matrices(rotations, acting.shift)


def _inverse(rotations: np.ndarray) -> np.ndarray:
    return np.swapaxes(rotations, -1, -2)


def _moved(matrices: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(F, 3) points, (F, 3) or (3,), moved by (F, 4, 4)."""
    points = np.broadcast_to(points, (len(matrices), 3))
    return np.einsum("fab,fb->fa", matrices[:, :3, :3], points) + matrices[:, :3, 3]


def _lift_shoulders(skeleton: Skeleton, acting: Acting, rotations: np.ndarray) -> None:
    """Raises the shoulder girdle with the hand, half in the collarbone, half in the shoulder."""
    for side, sign in enumerate((1.0, -1.0)):
        part = np.clip((acting.wrists[side, :, 1] + 0.35) / 0.8, 0, 1)
        part = part * part * (3 - 2 * part)
        angle = sign * (LIFTED[0] + (LIFTED[1] - LIFTED[0]) * part) / 2
        for bone in ("clavicle", "shoulder01"):
            joint = skeleton.index(f"{bone}.{SIDES[side]}")
            rotations[:, joint] = about(np.array([0.0, 0.0, 1.0]), angle)


def _place_arm(
    skeleton: Skeleton, acting: Acting, rotations: np.ndarray, world: np.ndarray, side: int
) -> None:
    """Brings a wrist where it is to be, and bends hand and fingers."""
    s = SIDES[side]
    limb = Limb.of(skeleton, f"upperarm01.{s}", f"lowerarm01.{s}", f"wrist.{s}")
    chest = world[:, skeleton.index("spine01")]
    parent = world[:, skeleton.index(f"shoulder01.{s}")]
    target = _moved(chest, skeleton.at[limb.upper] + acting.wrists[side])
    pole = np.einsum("fab,fb->fa", chest[:, :3, :3], acting.elbows[side])
    bend = reach(_moved(parent, skeleton.at[limb.upper]), target, limb.lengths, pole)
    upper, lower = limb.rotations(bend)
    swing, twist = split_twist(_inverse(parent[:, :3, :3]) @ upper, limb.rest.upper)
    along = limb.rest.upper
    rotations[:, limb.upper] = swing @ about(along, UPPER_TWIST * twist)
    second = skeleton.index(f"upperarm02.{s}")
    rotations[:, second] = about(along, (1 - UPPER_TWIST) * twist)
    rotations[:, limb.lower] = _inverse(upper) @ lower
    _turn_hand(skeleton, acting, rotations, limb, side)


def _turn_hand(
    skeleton: Skeleton, acting: Acting, rotations: np.ndarray, limb: Limb, side: int
) -> None:
    """Turns the palm, half in the forearm and half in the wrist, and curls the fingers."""
    s, sign = SIDES[side], (1.0, -1.0)[side]
    half = about(limb.rest.lower, sign * 0.5 * acting.palms[side])
    curl, normal = _hand_axes(skeleton, s)
    rotations[:, skeleton.index(f"lowerarm02.{s}")] = half
    rotations[:, limb.end] = half @ about(curl, acting.flexed[side])
    bent = about(curl, acting.curled[side])
    for finger in FINGERS:
        first, *rest = (skeleton.index(f"{finger}-{phalanx}.{s}") for phalanx in (1, 2, 3))
        rotations[:, first] = about(normal, _gathered(skeleton, finger, s, normal)) @ bent
        rotations[:, rest] = bent[:, None]
    for phalanx in (1, 2, 3):
        thumb = skeleton.index(f"finger1-{phalanx}.{s}")
        rotations[:, thumb] = about(curl, THUMB_CURL * acting.curled[side])


def _along(skeleton: Skeleton, finger: str, s: str) -> np.ndarray:
    """(3,) direction of a finger at rest."""
    first, last = (skeleton.at[skeleton.index(f"{finger}-{n}.{s}")] for n in (1, 3))
    return unit(last - first)


def _hand_axes(skeleton: Skeleton, s: str) -> tuple[np.ndarray, np.ndarray]:
    """(3,) about which fingers bend towards the palm, and (3,) what stands on the palm."""
    index, little = (skeleton.at[skeleton.index(f"{f}-1.{s}")] for f in ("finger2", "finger5"))
    along = _along(skeleton, "finger3", s)
    across = unit(little - index)
    axis = unit(across - (across @ along) * along) * (1.0 if s == "R" else -1.0)
    return axis, np.cross(axis, along)


def _gathered(skeleton: Skeleton, finger: str, s: str, normal: np.ndarray) -> float:
    """Radians about the palm's normal that bring a spread finger nearer to the middle one."""
    own, middle = _along(skeleton, finger, s), _along(skeleton, "finger3", s)
    return GATHERED * float(np.arctan2(np.cross(own, middle) @ normal, own @ middle))


def _place_leg(
    skeleton: Skeleton, acting: Acting, rotations: np.ndarray, world: np.ndarray, side: int
) -> None:
    """Brings an ankle where it is to be; the foot keeps its own direction."""
    s, sign = SIDES[side], (1.0, -1.0)[side]
    limb = Limb.of(skeleton, f"upperleg01.{s}", f"lowerleg01.{s}", f"foot.{s}")
    parent = world[:, skeleton.index(f"pelvis.{s}")]
    out = sign * acting.toes_out[side]
    forward = parent[:, :3, :3] @ np.array([np.sin(out), 0.0, np.cos(out)])
    bend = reach(
        _moved(parent, skeleton.at[limb.upper]), acting.ankles[side], limb.lengths, forward
    )
    upper, lower = limb.rotations(bend)
    rotations[:, limb.upper] = _inverse(parent[:, :3, :3]) @ upper
    rotations[:, limb.lower] = _inverse(upper) @ lower
    sole = np.zeros((len(world), 3))
    sole[:, 0], sole[:, 1] = acting.tiptoe[side], out
    rotations[:, limb.end] = _inverse(lower) @ turned(sole)
