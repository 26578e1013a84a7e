"""What somebody did in a recording, by role, and what their hands and head did there."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ico3d.motion.gestures.hanging import hanging
from ico3d.motion.person import Person, person_of
from ico3d.motion.retarget import DOWN, PALM
from ico3d.motion.roles import INDEX, SIDES
from ico3d.motion.turning import dot
from ico3d.rig.quaternions import (
    Array,
    conjugate,
    continuous,
    multiply,
    normalized,
    rotate,
    to_rotvec,
)
from ico3d.rig.rig import Rig

SMOOTH = 0.1
"""Seconds over which a speed is averaged."""
STEADY = 0.1
"""Seconds before and after a frame that tell how somebody stood in it."""
FOUR = ("index", "middle", "ring", "little")


@dataclass(frozen=True, eq=False)
class Hand:
    """A hand in F frames; vectors in the chest's axes: outwards, upwards, forwards.

    Attributes:
        place: (F, 3) of the wrist from where the shoulder is at rest, in arm lengths.
        knuckles: (F, 3) the same of the middle finger's knuckle.
        tip: (F, 3) the same of where straight fingers end.
        palm: (F, 3) where it looks.
        fingers: (F, 3) where straight fingers point.
        bends: (F, 4) degrees by which index to little finger are bent; none where a rig lacks them.
        lifted: (F,) degrees by which the collarbone is lifted.
        to_chin: (F,) from the tip to the chin, in arm lengths.
        to_heart: (F,) from the knuckles to the breastbone, in arm lengths.
    """

    place: Array
    knuckles: Array
    tip: Array
    palm: Array
    fingers: Array
    bends: Array
    lifted: Array
    to_chin: Array
    to_heart: Array

    @property
    def reach(self) -> Array:
        """(F,) how far the wrist is from the shoulder, in arm lengths."""
        return np.linalg.norm(self.place, axis=-1)


@dataclass(frozen=True, eq=False)
class Recording:
    """F frames of somebody.

    Attributes:
        person: Who.
        fps: Frames per second.
        poses: (F, R, 4) by role.
    """

    person: Person
    fps: float
    poses: Array

    @property
    def num_frames(self) -> int:
        """F."""
        return len(self.poses)

    def frames(self, seconds: float) -> int:
        """The whole number of frames that so many seconds have; one at least."""
        return max(1, round(seconds * self.fps))

    @cached_property
    def hands(self) -> dict[str, Hand]:
        """Both hands by side."""
        return hands_of(self.person, self.poses)

    @cached_property
    def hanging(self) -> dict[str, Hand]:
        """The same of hanging arms: one frame."""
        return hands_of(self.person, hanging(self.person)[None])

    @cached_property
    def head(self) -> Array:
        """(F, 3) rotation vectors of the head against the chest: down, to the left, aside."""
        neck, head = self.poses[:, INDEX["neck"]], self.poses[:, INDEX["head"]]
        return to_rotvec(continuous(multiply(neck, head)))

    def speed(self, side: str) -> Array:
        """(F,) arm lengths a second of a hand's knuckles, against the chest."""
        return self.smoothed(speeds(self.hands[side].knuckles, self.fps))

    def smoothed(self, values: Array) -> Array:
        """(F,) means over `SMOOTH` seconds around each frame."""
        width = min(2 * (self.frames(SMOOTH) // 2) + 1, len(values))
        padded = np.pad(values, width // 2, mode="edge")
        return np.convolve(padded, np.full(width, 1 / width), "valid")[: len(values)]


def recording_of(rig: Rig, fps: float, rotations: np.ndarray) -> Recording:
    """What a body track or a trained body tells.

    Args:
        rig: J joints at rest.
        fps: Frames per second.
        rotations: (F, J, 4) wxyz of each joint about itself.

    Raises:
        SettingsError: If the rig lacks a role without which nobody stands or gestures.
    """
    person = person_of(rig)
    poses = person.retarget.by_role(np.asarray(rotations, np.float64))
    return Recording(person, fps, steadied(continuous(poses), fps))


def steadied(poses: Array, fps: float) -> Array:
    """Rotations (F, ..., 4) without the jitter of poses that were found frame by frame.

    A parabola through the frames around each one (Savitzky and Golay) keeps the height of quick
    strokes.
    """
    half = min(max(1, round(STEADY * fps)), (len(poses) - 1) // 2)
    if half < 2:  # a parabola goes through three frames
        return poses
    around = np.arange(-half, half + 1)
    weights = np.linalg.pinv(np.vander(around, 3, increasing=True))[0]  # (2 half + 1,)
    before = 2 * poses[:1] - poses[half:0:-1]
    after = 2 * poses[-1:] - poses[-2 : -half - 2 : -1]
    padded = np.concatenate([before, poses, after])  # (F + 2 half, ..., 4)
    windows = np.lib.stride_tricks.sliding_window_view(padded, len(around), axis=0)
    return normalized(windows @ weights)


def speeds(places: Array, fps: float) -> Array:
    """(F,) lengths a second of a point (F, 3): the mean of the steps before and after."""
    if len(places) < 2:
        return np.zeros(len(places))
    steps = np.linalg.norm(np.diff(places, axis=0), axis=-1) * fps  # (F - 1,)
    padded = np.concatenate([steps[:1], steps, steps[-1:]])  # (F + 1,)
    return (padded[:-1] + padded[1:]) / 2


def hands_of(person: Person, poses: Array) -> dict[str, Hand]:
    """Hands by side in poses (F, R, 4) by role."""
    world = person.retarget.world(poses)
    places = person.posed(poses, np.zeros(3))
    rotations = person.retarget.pose(poses)
    chin = person.carried("head", person.chin, rotations, np.zeros(3))
    chest = conjugate(world[:, INDEX["chest"]])

    def carried(point: Array) -> Array:  # in rest space, as the chest carries it
        return person.place("chest") + rotate(chest, point - places["chest"])

    found: dict[str, Hand] = {}
    for side, outwards in zip(SIDES, (1.0, -1.0), strict=True):
        mirror, arm = np.array([outwards, 1.0, 1.0]), person.arm(side)
        shoulder = person.place(f"{side}_shoulder")
        wrist = carried(places[f"{side}_wrist"])
        turned = multiply(chest, world[:, INDEX[f"{side}_wrist"]])
        along = rotate(turned, DOWN)  # (F, 3)
        knuckles = wrist + person.hand(side) * along
        tip = wrist + 1.9 * person.hand(side) * along
        lifted = to_rotvec(poses[:, INDEX[f"{side}_clavicle"]])[:, 2]
        found[side] = Hand(
            place=mirror * (wrist - shoulder) / arm,
            knuckles=mirror * (knuckles - shoulder) / arm,
            tip=mirror * (tip - shoulder) / arm,
            palm=mirror * rotate(turned, PALM[side]),
            fingers=mirror * along,
            bends=_bends(person, side, world),
            lifted=np.degrees(outwards * lifted),
            to_chin=np.linalg.norm(tip - carried(chin), axis=-1) / arm,
            to_heart=np.linalg.norm(knuckles - person.chest, axis=-1) / arm,
        )
    return found


def _bends(person: Person, side: str, world: Array) -> Array:
    """(F, 4) degrees between the hand's direction and the last bone of each finger."""
    if not all(f"{side}_{finger}3" in person.cast.joints for finger in FOUR):
        return np.zeros((len(world), 0))
    hand = rotate(world[:, INDEX[f"{side}_wrist"]], DOWN)[:, None]  # (F, 1, 3)
    ends = rotate(world[:, [INDEX[f"{side}_{finger}3"] for finger in FOUR]], DOWN)  # (F, 4, 3)
    return np.degrees(np.arccos(np.clip(dot(hand, ends), -1, 1)))
