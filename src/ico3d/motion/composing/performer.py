"""Poses of the whole body: the living rest, turned to the visitor, with gestures blended in."""

from dataclasses import dataclass

import numpy as np

from ico3d.motion.clip import Clip
from ico3d.motion.composing.cues import Cue, Direction, Release, clip_time, end_of, weight
from ico3d.motion.living import Living
from ico3d.motion.roles import INDEX, ROLES
from ico3d.motion.turning import power
from ico3d.rig.quaternions import Array, multiply, slerp

ADDED = np.array(
    [role in ("hips", "spine", "chest", "neck", "head") or "clavicle" in role for role in ROLES]
)
"""(R,) bool: roles whose rotations in gestures are added to the rest; others replace the rest."""


@dataclass(frozen=True)
class _Part:
    """A gesture at T times.

    Attributes:
        roles: (M,) indices of the roles that it moves.
        poses: (T, M, 4) rotations of these roles, wxyz.
        weight: (T,) weight of the gesture, 0 to 1.
    """

    roles: np.ndarray
    poses: Array
    weight: Array


class Performer:
    """A person who follows directions.

    Attributes:
        living: The person at rest.
    """

    def __init__(self, living: Living, clips: dict[str, Clip]):
        """Makes a performer without directions.

        Args:
            living: The person at rest.
            clips: Clips by name.
        """
        self.living = living
        self._clips = {(name, False): clip for name, clip in clips.items()}
        self._clips |= {(name, True): clip.mirrored() for name, clip in clips.items()}
        self._cues: list[Cue] = []
        self._releases: dict[int, float] = {}

    def follow(self, directions: list[Direction]) -> None:
        """Adds directions; the clips of their cues must be known."""
        for direction in directions:
            if isinstance(direction, Release):
                self._releases[direction.number] = direction.time
            else:
                self._cues.append(direction)

    def drop(self, now: float) -> None:
        """Removes gestures that begin at a time or later, after their speech was interrupted."""
        self._cues = [cue for cue in self._cues if cue.begin < now]

    def at(self, times: Array, turn: Array | None = None) -> tuple[Array, Array]:
        """Poses of the body at some times.

        Args:
            times: (T,) seconds.
            turn: (T, 3, 4) rotations of chest, neck and head to the visitor, as by `Gaze.at`.

        Returns:
            (T, R, 4) local rotations by role, wxyz, and (T, 3) translation of the root from rest,
            metres.
        """
        times = np.atleast_1d(np.asarray(times, float))
        pose, root = self.living.at(times)
        if turn is not None:
            rows = [INDEX[role] for role in ("chest", "neck", "head")]
            pose[:, rows] = multiply(turn, pose[:, rows])
        left = np.ones((len(times), len(ROLES)))  # (T, R) share that later gestures leave over
        parts = [part for cue in self._cues if (part := self._part(cue, times)) is not None]
        for part in reversed(parts):
            added = part.roles[ADDED[part.roles]]
            chosen = ADDED[part.roles]
            share = part.weight[:, None] * left[:, added]
            pose[:, added] = multiply(pose[:, added], power(part.poses[:, chosen], share))
            left[:, added] *= 1 - part.weight[:, None]
        for part in parts:
            chosen = ~ADDED[part.roles]
            roles = part.roles[chosen]
            share = np.broadcast_to(part.weight[:, None], (len(times), len(roles)))
            pose[:, roles] = slerp(pose[:, roles], part.poses[:, chosen], share)
        return pose, root

    def _part(self, cue: Cue, times: Array) -> _Part | None:
        """The gesture of a cue at times (T,); None if it is not made at these times."""
        clip = self._clips[cue.name, cue.mirror]
        release = self._releases.get(cue.number)
        if times.max() < cue.begin or times.min() > end_of(clip, release):
            return None
        moments = clip_time(clip, cue, release, times)
        return _Part(clip.roles, clip.at(moments), weight(clip, cue, release, times))
