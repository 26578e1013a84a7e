"""Makes clips from cuts of a recording: rotation curves that begin and end with hanging arms."""

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
"""Duration of a stroke in seconds."""
HOLD = 0.4
"""Duration in seconds of the hold of gestures that do not repeat a motion."""
ARRIVING, LEAVING = 0.15, 0.3
"""Seconds in which motion comes to rest before the hold, and resumes after it."""
HANGING = 0.12
"""Arm lengths from where hands hang, up to which a clip begins and ends with recorded motion."""
PACE = 1.6
"""Speed, in arm lengths per second, of added motion from and to hanging arms."""
LEAST = 0.35
"""Least duration of such added motion, seconds."""
BACK = 0.5
"""A motion is repeated if it returns to within this share of its size of its beginning."""
MOVED = 0.12
"""Least size of a repeated motion, arm lengths."""
FAINT = 0.5
"""Degrees above which the rotation of a role of torso or head is kept in a clip."""
FARTHEST = np.radians(20.0), np.radians(25.0)
"""Largest rotation of the torso, and of the head, in a clip, radians."""


def recorded_clips(recording: Recording, cuts: Iterable[Cut]) -> dict[str, Clip]:
    """Makes clips from the cuts of a recording, except from those of rest.

    Returns:
        Clips by name; the second clip of a name gets `_2` appended, and so on.
    """
    cuts = list(cuts)
    still, hung = _still(recording, cuts), hung_in(recording, cuts)
    gestures = named(cut for cut in cuts if cut.name != REST)
    return {name: _Take(recording, cut, still, hung).clip(name) for name, cut in gestures}


def hung_in(recording: Recording, cuts: Iterable[Cut]) -> Array:
    """(R, 4) pose by role with arms as they hang in the recorded rest, else the standard pose.

    Without a cut of rest, arms hang as near to the body as its width allows (`hanging`).
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
    """(R, 4) mean pose by role of the recorded rest; without one, the pose of the first frame."""
    spans = [range(cut.first, cut.last + 1) for cut in cuts if cut.name == REST]
    poses = recording.poses[list(spans[0]) if spans else [0]]
    return normalized(poses.mean(0))


@dataclass(frozen=True, eq=False)
class _Take:
    """Makes the clip of one cut.

    Attributes:
        recording: The recording.
        cut: The frames.
        still: (R, 4) pose by role at rest, as recorded.
        hung: (R, 4) pose by role with hanging arms, else the standard pose.
    """

    recording: Recording
    cut: Cut
    still: Array
    hung: Array

    def clip(self, name: str) -> Clip:
        """The clip of the cut, with a name."""
        frames = self._frames()
        hold = self._hold()
        lead, tail = (self._way(frame) for frame in (self.cut.first, self.cut.last))
        before = self._seconds(self.cut.stroke - self.cut.first)
        if lead + before < (STROKE if self.cut.sides else 1 / RATE):
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
        """Roles that the clip moves: of hands that take part, and of torso and head if they turn.

        `frames` (F, R, 4) are those of `_frames`.
        """
        there = self.recording.person.cast.joints
        torso = ("spine", "chest", "neck", "head") if self.cut.sides else ("neck", "head")
        turned = angles(IDENTITY, frames).max(0)  # (R,) degrees
        own = [role for role in torso if turned[INDEX[role]] > FAINT]
        own += [role for side in self.cut.sides for role in arm_roles(side)]
        return tuple(role for role in ROLES if role in own and role in there)

    def _hold(self) -> float:
        """Duration of the hold in seconds: 0 for the head; one repetition for repeated motion."""
        if not self.cut.sides:
            return 0.0
        return self._seconds(self.cut.release - self.cut.stroke) if self.repeats else HOLD

    @property
    def repeats(self) -> bool:
        """Whether a hand moves and returns between stroke and release, which can be repeated."""
        first, last = self.cut.stroke, self.cut.release
        for side in self.cut.sides:
            tips = self.recording.hands[side].tip[first : last + 1]
            size = float(np.ptp(tips, axis=0).max())
            if size > MOVED and np.linalg.norm(tips[-1] - tips[0]) < BACK * size:
                return True
        return False

    def _way(self, frame: int) -> float:
        """Seconds for moving hands between their place at a frame and hanging; 0 if they hang."""
        person = self.recording
        far = [
            np.linalg.norm(person.hands[side].knuckles[frame] - person.hanging[side].knuckles[0])
            for side in self.cut.sides
        ]
        farthest = float(max(far, default=0.0))
        return max(farthest / PACE, LEAST) if farthest > HANGING else 0.0

    def _frames(self) -> Array:
        """(F, R, 4) poses by role of the cut's frames, as a `Performer` needs them.

        A performer adds rotations of torso, head and collarbones to those of the rest. So torso and
        head get their deviation from an even motion between first and last frame, up to `FARTHEST`,
        with the rotation of hips included in that of the torso; collarbones get theirs from the
        recorded rest. Arms keep their rotations relative to the chest.
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
        """(T, R, 4) poses at times after the first frame, with a hold.

        Args:
            times: (T,) seconds from the first frame.
            frames: (F, R, 4) poses of the cut.
            before: Seconds from the first frame to the stroke's arrival, where the hold begins.
            hold: Duration of the hold in seconds.
        """
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
        """(T, R, 4) poses `own`, blended with hanging arms at the beginning and at the end.

        Args:
            times: (T,) seconds of the clip.
            own: (T, R, 4) poses of the gesture.
            lead: Duration of the blend at the beginning, seconds; 0 for none.
            end: Time at which the blend at the end begins, seconds.
        """
        hung = np.broadcast_to(self.hung, own.shape)
        down = np.zeros_like(times)  # (T,) weight of hanging arms
        if lead:
            down = 1 - eased(times / lead)
        if end < times[-1]:
            down = np.maximum(down, eased((times - end) / (times[-1] - end)))
        return slerp(own, hung, down[:, None])


def _beyond(turned: Array, part: Array, farthest: float) -> Array:
    """(F, 4) deviations of rotations from an even motion between the first and the last.

    Args:
        turned: (F, 4) rotations.
        part: (F,) share of the way, from 0 to 1.
        farthest: Largest angle of a deviation, radians.
    """
    even = slerp(turned[:1], turned[-1:], part)
    vector = to_rotvec(multiply(conjugate(even), turned))
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return from_rotvec(vector * np.minimum(1.0, farthest / np.maximum(angle, 1e-9)))


def _at(frames: Array, places: Array) -> Array:
    """(T, R, 4) poses at places (T,) among frames (F, R, 4), interpolated and clamped."""
    places = np.clip(places, 0, len(frames) - 1)
    index = np.minimum(places.astype(int), max(len(frames) - 2, 0))
    after = np.minimum(index + 1, len(frames) - 1)
    return slerp(frames[index], frames[after], (places - index)[:, None])


def _smooth(x: Array) -> Array:
    """Smoothstep: 0 up to x = 0, 1 from x = 1, with slope 0 at both."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)
