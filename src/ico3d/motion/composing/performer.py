"""The whole body at a moment: the living rest, turned to the visitor, with gestures upon it."""

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
"""(R,) roles whose gestures come upon what the rest does; those of the others replace it."""


@dataclass(frozen=True)
class _Part:
    """A gesture in T moments: roles (M,), their rotations (T, M, 4), and its weight (T,)."""

    roles: np.ndarray
    poses: Array
    weight: Array


class Performer:
    """Somebody who follows directions."""

    def __init__(self, living: Living, clips: dict[str, Clip]):
        """Somebody at rest.

        Args:
            living: The rest.
            clips: By name.
        """
        self.living = living
        self._clips = {(name, False): clip for name, clip in clips.items()}
        self._clips |= {(name, True): clip.mirrored() for name, clip in clips.items()}
        self._cues: list[Cue] = []
        self._releases: dict[int, float] = {}

    def follow(self, directions: list[Direction]) -> None:
        """Takes on more directions."""
        for direction in directions:
            if isinstance(direction, Release):
                self._releases[direction.number] = direction.time
            else:
                self._cues.append(direction)

    def drop(self, now: float) -> None:
        """Forgets gestures that have not begun: what they belonged to was interrupted."""
        self._cues = [cue for cue in self._cues if cue.begin < now]

    def at(self, times: Array, turn: Array | None = None) -> tuple[Array, Array]:
        """How the body is at seconds (T,).

        Args:
            times: Seconds.
            turn: (T, 3, 4) what chest, neck and head turn to the visitor (`gaze.turns`).

        Returns:
            (T, R, 4) by role and (T, 3) metres that the root moves.
        """
        times = np.atleast_1d(np.asarray(times, float))
        pose, root = self.living.at(times)
        if turn is not None:
            rows = [INDEX[role] for role in ("chest", "neck", "head")]
            pose[:, rows] = multiply(turn, pose[:, rows])
        left = np.ones((len(times), len(ROLES)))  # (T, R) what later gestures leave of earlier ones
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
        """What a gesture does then; None where it does nothing."""
        clip = self._clips[cue.name, cue.mirror]
        release = self._releases.get(cue.number)
        if times.max() < cue.begin or times.min() > end_of(clip, release):
            return None
        moments = clip_time(clip, cue, release, times)
        return _Part(clip.roles, clip.at(moments), weight(clip, cue, release, times))
