"""A recorded motion as poses by role, with measures of the hands and the head."""

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
"""Seconds before and after a frame whose poses are used to smooth the pose of the frame."""
FOUR = ("index", "middle", "ring", "little")
"""The fingers without the thumb."""


@dataclass(frozen=True, eq=False)
class Hand:
    """Measures of a hand in F frames.

    Vectors are in the chest's axes: outwards (away from the other hand), upwards, forwards. Lengths
    are in arm lengths, from shoulder to wrist.

    Attributes:
        place: (F, 3) position of the wrist relative to the shoulder at rest.
        knuckles: (F, 3) position of the middle finger's knuckle relative to the shoulder at rest.
        tip: (F, 3) position of the tips of straight fingers relative to the shoulder at rest.
        palm: (F, 3) unit direction in which the palm looks.
        fingers: (F, 3) unit direction in which straight fingers point.
        bends: (F, 4) angles of index to little finger in degrees; (F, 0) for a rig without them.
        lifted: (F,) angle by which the collarbone is lifted, degrees.
        to_chin: (F,) distance from `tip` to the chin.
        to_heart: (F,) distance from `knuckles` to the breastbone.
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
        """(F,) distance of the wrist from the shoulder at rest, arm lengths."""
        return np.linalg.norm(self.place, axis=-1)


@dataclass(frozen=True, eq=False)
class Recording:
    """The motion of a person in F frames.

    Attributes:
        person: Who was recorded.
        fps: Frames per second.
        poses: (F, R, 4) poses by role, wxyz.
    """

    person: Person
    fps: float
    poses: Array

    @property
    def num_frames(self) -> int:
        """Number F of frames."""
        return len(self.poses)

    def frames(self, seconds: float) -> int:
        """Number of frames in a duration, rounded; at least one."""
        return max(1, round(seconds * self.fps))

    @cached_property
    def hands(self) -> dict[str, Hand]:
        """Measures of both hands, by side."""
        return hands_of(self.person, self.poses)

    @cached_property
    def hanging(self) -> dict[str, Hand]:
        """Measures of both hands with hanging arms (`hanging`), by side, as of one frame."""
        return hands_of(self.person, hanging(self.person)[None])

    @cached_property
    def head(self) -> Array:
        """(F, 3) rotation vectors of the head relative to the chest, radians.

        Positive coordinates turn the head down, to the left, and towards the right shoulder.
        """
        neck, head = self.poses[:, INDEX["neck"]], self.poses[:, INDEX["head"]]
        return to_rotvec(continuous(multiply(neck, head)))

    def speed(self, side: str) -> Array:
        """(F,) speed of a hand's knuckles relative to the chest, arm lengths per second."""
        return self.smoothed(speeds(self.hands[side].knuckles, self.fps))

    def smoothed(self, values: Array) -> Array:
        """(F,) means over `SMOOTH` seconds around each frame."""
        width = min(2 * (self.frames(SMOOTH) // 2) + 1, len(values))
        padded = np.pad(values, width // 2, mode="edge")
        return np.convolve(padded, np.full(width, 1 / width), "valid")[: len(values)]


def recording_of(rig: Rig, fps: float, rotations: np.ndarray) -> Recording:
    """Makes a recording of the poses of a body track or a trained body; poses are smoothed.

    Args:
        rig: The skeleton.
        fps: Frames per second.
        rotations: (F, J, 4) local rotations of the joints, wxyz.

    Raises:
        SettingsError: If the rig lacks a role that is needed to stand or gesture.
    """
    person = person_of(rig)
    poses = person.retarget.by_role(np.asarray(rotations, np.float64))
    return Recording(person, fps, steadied(continuous(poses), fps))


def steadied(poses: Array, fps: float) -> Array:
    """Smooths rotations (F, ..., 4) that jitter because each frame was fitted on its own.

    A parabola is fitted to the frames around each frame (Savitzky and Golay), which keeps the size
    of quick strokes.
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
    return normalized(windows @ weights)  # windows: (F, ..., 4, 2 half + 1)


def speeds(places: Array, fps: float) -> Array:
    """(F,) speed per second of a point (F, 3): mean of the steps before and after each frame."""
    if len(places) < 2:
        return np.zeros(len(places))
    steps = np.linalg.norm(np.diff(places, axis=0), axis=-1) * fps  # (F - 1,)
    padded = np.concatenate([steps[:1], steps, steps[-1:]])  # (F + 1,)
    return (padded[:-1] + padded[1:]) / 2


def hands_of(person: Person, poses: Array) -> dict[str, Hand]:
    """Measures of both hands, by side, in poses (F, R, 4) by role."""
    world = person.retarget.world(poses)
    places = person.posed(poses, np.zeros(3))
    rotations = person.retarget.pose(poses)
    chin = person.carried("head", person.chin, rotations, np.zeros(3))
    chest = conjugate(world[:, INDEX["chest"]])

    def carried(point: Array) -> Array:  # from the world to rest space as it moves with the chest
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
    """(F, 4) angles in degrees between the hand's direction and the last bone of each finger.

    (F, 0) for a rig without fingers; `world` (F, R, 4) are rotations by `Retarget.world`.
    """
    if not all(f"{side}_{finger}3" in person.cast.joints for finger in FOUR):
        return np.zeros((len(world), 0))
    hand = rotate(world[:, INDEX[f"{side}_wrist"]], DOWN)[:, None]  # (F, 1, 3)
    ends = rotate(world[:, [INDEX[f"{side}_{finger}3"] for finger in FOUR]], DOWN)  # (F, 4, 3)
    return np.degrees(np.arccos(np.clip(dot(hand, ends), -1, 1)))
