"""Makes clips of cuts: rotation curves by role that begin and end with hanging arms."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ico3d.motion.clip import Clip, Marks, clip_of
from ico3d.motion.curves import angles
from ico3d.motion.gestures.hanging import hanging
from ico3d.motion.gestures.solve import RATE, SHARED, eased
from ico3d.motion.recorded.cut import REST, Cut, named
from ico3d.motion.recorded.recording import Recording
from ico3d.motion.roles import INDEX, ROLES, SIDES, arm_roles
from ico3d.motion.turning import power
from ico3d.rig.quaternions import (
    IDENTITY,
    Array,
    conjugate,
    from_rotvec,
    multiply,
    normalized,
    slerp,
    to_rotvec,
)

STROKE = 0.3
"""Seconds before a stroke arrives at which it begins."""
HOLD = 0.4
"""Seconds that the end of a stroke stays."""
ARRIVING, LEAVING = 0.15, 0.3
"""Seconds in which motion comes to rest for the hold, and goes on after it."""
HANGING = 0.12
"""Arm lengths from where a hanging hand is up to which a clip may begin and end as recorded."""
PACE = 1.6
"""Arm lengths a second of hands that are brought there and back where the recording lacks it."""
LEAST = 0.35
"""Seconds that it takes at least."""
BACK = 0.5
"""Part of their way that repeating hands may be away from where they began."""
MOVED = 0.12
"""Arm lengths that hands go which repeat something."""
FAINT = 0.5
"""Degrees that a part of torso or head turns at least, where a clip moves it."""
FARTHEST = np.radians(20.0), np.radians(25.0)
"""How far a clip turns the torso, and the head."""


def recorded_clips(recording: Recording, cuts: Iterable[Cut]) -> dict[str, Clip]:
    """Clips by name; further ones of a name are numbered from 2 on. What is rest is no clip."""
    cuts = list(cuts)
    still, hung = _still(recording, cuts), hung_in(recording, cuts)
    gestures = named(cut for cut in cuts if cut.name != REST)
    return {name: _Take(recording, cut, still, hung).clip(name) for name, cut in gestures}


def hung_in(recording: Recording, cuts: Iterable[Cut]) -> Array:
    """(R, 4) by role: arms as they hang where somebody rests, all else as in the standard pose.

    Where nobody rests, arms hang as near as the body allows.
    """
    hung = hanging(recording.person)
    if not any(cut.name == REST for cut in cuts):
        return hung
    still = _still(recording, list(cuts))
    for side in SIDES:
        own = [INDEX[role] for role in arm_roles(side)]
        hung[own] = still[own]
        collar, shoulder = INDEX[f"{side}_clavicle"], INDEX[f"{side}_shoulder"]
        hung[shoulder] = multiply(still[collar], still[shoulder])
        hung[collar] = IDENTITY
    return hung


def _still(recording: Recording, cuts: list[Cut]) -> Array:
    """(R, 4) by role: how somebody rests; where nobody does, how they are at first."""
    spans = [range(cut.first, cut.last + 1) for cut in cuts if cut.name == REST]
    poses = recording.poses[list(spans[0]) if spans else [0]]
    return normalized(poses.mean(0))


@dataclass(frozen=True, eq=False)
class _Take:
    """One cut of a recording.

    Attributes:
        recording: Of whom.
        cut: Which frames.
        still: (R, 4) by role, at rest.
        hung: (R, 4) by role, with hanging arms.
    """

    recording: Recording
    cut: Cut
    still: Array
    hung: Array

    def clip(self, name: str) -> Clip:
        """The clip under a name."""
        frames = self._frames()
        hold = self._hold()
        lead, tail = (self._way(frame) for frame in (self.cut.first, self.cut.last))
        before = self._seconds(self.cut.stroke - self.cut.first)
        if self.cut.sides and lead + before < STROKE:
            lead = LEAST
        after = self._seconds(self.cut.last - self.cut.release)
        stroke = lead + before
        marks = Marks(
            max(stroke - STROKE, 0.0), stroke, stroke, stroke + hold, stroke + hold + after + tail
        )
        times = np.append(np.arange(0, marks.end, 1 / RATE), marks.end)
        if times[-1] - times[-2] < 0.5 / RATE:
            times = np.delete(times, -2)
        own = self._within(times - lead, frames, before, hold)  # (T, R, 4)
        poses = self._brought(times, own, lead, marks.end - tail)
        return clip_of(name, marks, times, poses, self._roles(frames))

    def _seconds(self, frames: int) -> float:
        return frames / self.recording.fps

    def _roles(self, frames: Array) -> tuple[str, ...]:
        """Those that move: of the hands that take part, of head and torso where they do."""
        there = self.recording.person.cast.joints
        torso = ("spine", "chest", "neck", "head") if self.cut.sides else ("neck", "head")
        turned = angles(IDENTITY, frames).max(0)  # (R,) degrees
        own = [role for role in torso if turned[INDEX[role]] > FAINT]
        own += [role for side in self.cut.sides for role in arm_roles(side)]
        return tuple(role for role in ROLES if role in own and role in there)

    def _hold(self) -> float:
        """Seconds of the hold: of a head none, of hands that repeat something one time round."""
        if not self.cut.sides:
            return 0.0
        return self._seconds(self.cut.release - self.cut.stroke) if self.repeats else HOLD

    @property
    def repeats(self) -> bool:
        """Whether hands go somewhere and come back between stroke and release."""
        first, last = self.cut.stroke, self.cut.release
        for side in self.cut.sides:
            tips = self.recording.hands[side].tip[first : last + 1]
            size = float(np.ptp(tips, axis=0).max())
            if size > MOVED and np.linalg.norm(tips[-1] - tips[0]) < BACK * size:
                return True
        return False

    def _way(self, frame: int) -> float:
        """Seconds that hands need between a frame and hanging; 0 where they hang."""
        person = self.recording
        far = [
            np.linalg.norm(person.hands[side].knuckles[frame] - person.hanging[side].knuckles[0])
            for side in self.cut.sides
        ]
        farthest = float(max(far, default=0.0))
        return max(farthest / PACE, LEAST) if farthest > HANGING else 0.0

    def _frames(self) -> Array:
        """(F, R, 4) from first to last frame as a performer uses them.

        Torso and head come upon what the rest does: from how they are at the first frame to how
        they are at the last one, as far as a person standing in place turns them. Hips stay. Arms
        keep their places on the chest.
        """
        poses = self.recording.poses[self.cut.first : self.cut.last + 1].copy()
        part = np.linspace(0, 1, len(poses))
        hips, spine, chest = (poses[:, INDEX[role]] for role in ("hips", "spine", "chest"))
        torso = _beyond(multiply(multiply(hips, spine), chest), part, FARTHEST[0])
        head = multiply(poses[:, INDEX["neck"]], poses[:, INDEX["head"]])
        head = _beyond(head, part, FARTHEST[1])
        for whole, roles in ((torso, ("spine", "chest")), (head, ("neck", "head"))):
            for role in roles:
                poses[:, INDEX[role]] = power(whole, SHARED[role])
        for side in self.cut.sides:
            collar, shoulder = INDEX[f"{side}_clavicle"], INDEX[f"{side}_shoulder"]
            lifted = multiply(conjugate(self.still[collar]), poses[:, collar])
            girdle = multiply(poses[:, collar], poses[:, shoulder])
            poses[:, collar] = lifted
            poses[:, shoulder] = multiply(conjugate(lifted), girdle)
        return poses

    def _within(self, times: Array, frames: Array, before: float, hold: float) -> Array:
        """(T, R, 4) at seconds (T,) from the first frame on, with a hold after `before` seconds."""
        stroke = self.cut.stroke - self.cut.first
        release = self.cut.release - self.cut.first
        fps = self.recording.fps
        after = times - before - hold
        if not self.cut.sides:
            return _at(frames, times * fps)
        if self.repeats:
            closing = to_rotvec(multiply(conjugate(frames[release]), frames[stroke]))  # (R, 3)
            part = np.where(after < 0, np.clip(times - before, 0, None) / max(hold, 1e-9), 1.0)
            part = np.where(after > 0, 1 - _smooth(after / LEAVING), part)
            return multiply(_at(frames, times * fps), from_rotvec(part[:, None, None] * closing))
        held = np.broadcast_to(frames[stroke], (len(times), *frames.shape[1:]))
        there = _smooth((times - before + ARRIVING) / ARRIVING)[:, None]
        coming = slerp(_at(frames, np.minimum(times, before) * fps), held, there)
        back = _at(frames, release + np.maximum(after, 0) * fps)
        going = slerp(held, back, _smooth(after / LEAVING)[:, None])
        return np.where((after > 0)[:, None, None], going, coming)

    def _brought(self, times: Array, own: Array, lead: float, end: float) -> Array:
        """Lets arms hang at second 0 and at the last one, where they do not."""
        hung = np.broadcast_to(self.hung, own.shape)
        down = np.zeros_like(times)  # (T,) how far arms hang
        if lead:
            down = 1 - eased(times / lead)
        if end < times[-1]:
            down = np.maximum(down, eased((times - end) / (times[-1] - end)))
        return slerp(own, hung, down[:, None])


def _beyond(turned: Array, part: Array, farthest: float) -> Array:
    """(F, 4) rotations beyond the even way from the first to the last one, up to an angle."""
    even = slerp(turned[:1], turned[-1:], part)
    vector = to_rotvec(multiply(conjugate(even), turned))
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return from_rotvec(vector * np.minimum(1.0, farthest / np.maximum(angle, 1e-9)))


def _at(frames: Array, places: Array) -> Array:
    """(T, R, 4) between frames (F, R, 4); before the first and after the last they stay."""
    places = np.clip(places, 0, len(frames) - 1)
    index = np.minimum(places.astype(int), max(len(frames) - 2, 0))
    after = np.minimum(index + 1, len(frames) - 1)
    return slerp(frames[index], frames[after], (places - index)[:, None])


def _smooth(x: Array) -> Array:
    """0 … 1 with zero slope at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)
