"""Procedural body animation: replays captured frames in a new order, as long as a speech lasts.

As in the paper's section "Procedural Body Animation", motion runs along the captured frames,
forwards or backwards, from one action's key frame to another, randomly chosen one, and ends at the
end of the rest loop together with the speech. The path is a list of points (audio time, body time)
with straight lines between them.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from ico3d.bundle.animation import Animation

Point = tuple[float, float]
"""A point of the path: seconds of the speech, seconds of body time."""
EASE = 0.2
"""Seconds in which motion accelerates from standing still, or slows down to it."""
RAMP = 4
"""Number of straight pieces that approximate one such acceleration."""
MOST_POINTS = 10_000
"""Points of the steady part of a motion, in which the speed is the same all the time."""
STEP = 0.25
"""Seconds between points of steady motion; small, so that a path can be sent piece by piece."""
SHORTEST = 0.25
"""Least body time in seconds between two visited actions; shorter motion looks like trembling."""
PAUSE = 0.6
"""Longest time in seconds for which a pose is held at a key frame; half of them are not held."""
LINGER = 1.0
"""Longest time in seconds for which an action is held if too little time is left for another."""
AGAIN = 0.25
"""Probability of returning to the previous action, relative to that of any other action."""
SAME = 1e-6
"""Differences of body time up to this, in seconds, count as none."""


@dataclass(frozen=True)
class Start:
    """State of a body at the beginning of a plan.

    Attributes:
        body_time: Body time in seconds.
        velocity: Body seconds per second, negative while playing backwards; 0 for a body that
            stands still, which may start in either direction.
    """

    body_time: float
    velocity: float = 0.0


def plan(
    animation: Animation,
    start: Start,
    seconds: float,
    random: np.random.Generator,
    gestures: bool = True,
) -> list[Point]:
    """The motion during a speech of known length.

    The motion begins at (0, start.body_time) and ends with the speech at the last frame of the rest
    loop; if that is too far away, it ends as soon as possible. Motion turns around only at key
    frames and at the ends of the rest loop, so a moving body first continues to the next key frame
    in its direction. Speeds stay within the animation's limits except while easing.

    Args:
        animation: Key frames, rest loop and limits of speed.
        start: State of the body at the beginning.
        seconds: Duration of the speech.
        random: Source of all random choices: actions, speeds, and how long poses are held.
        gestures: If False, the body goes to rest and stays there while the face talks.

    Returns:
        The path, from the first point to the last.
    """
    planner = Planner(animation, start, random, gestures=gestures)
    planner.end(seconds)
    return planner.points()


class Planner:
    """Plans the motion during a speech that is still growing; points once returned never change.

    At every moment the body could be back at rest when the sound known so far has ended, or
    `overrun` seconds later. Decisions are made as late as possible: a motion is chosen only when
    points after its beginning are asked for.
    """

    def __init__(
        self,
        animation: Animation,
        start: Start,
        random: np.random.Generator,
        at: float = 0.0,
        gestures: bool = True,
        overrun: float = 0.0,
    ):
        """Starts a plan that has only its first point.

        Args:
            animation: Key frames, rest loop and limits of speed.
            start: State of the body at the beginning.
            random: Source of all random choices.
            at: Seconds of the speech at which the plan begins.
            gestures: If False, the body stays at rest.
            overrun: Seconds by which motion may exceed the known sound while the speech has not
                ended; a larger value allows more gestures when sound arrives in small pieces.
        """
        self._animation, self._random, self._overrun = animation, random, overrun
        fps = animation.fps
        self._home, self._back = animation.rest.end / fps, animation.rest.start / fps
        actions = {action.frame / fps: action.score for action in animation.actions}
        self._turns = (self._back, self._home, *actions)
        self._gestures, self._actions = gestures, actions if gestures else {}
        self._place = min(max(start.body_time, 0.0), animation.seconds)
        self._before = self._place  # where the last motion began
        self._velocity = start.velocity
        self._time = self._known = at
        self._end: float | None = None
        self._wanted: float | None = None  # the action to visit next
        self._decided: deque[Point] = deque([(at, self._place)])  # and not yet handed out

    def know(self, seconds: float) -> None:
        """Tells that the speech lasts at least `seconds`."""
        self._known = max(self._known, seconds)

    def end(self, seconds: float) -> None:
        """Tells that the speech lasts exactly `seconds`."""
        self._known = self._end = seconds

    def visit(self, place: float) -> None:
        """Asks for the action at body time `place` in seconds, as soon as there is time for it."""
        if place in self._actions:
            self._wanted = place

    @property
    def is_over(self) -> bool:
        """Whether the last point of the path has been returned."""
        return not self._decided and self._has_arrived()

    def points(self, until: float = math.inf) -> list[Point]:
        """The points that follow those returned before.

        Args:
            until: Seconds of the speech up to which to return points, limited to the known sound
                while the speech has not ended; afterwards the path always leads to the end of the
                speech.
        """
        if self._end is None:
            until = min(until, self._known)
        while self._time < until and not self._has_arrived():
            self._decide(until)
        found: list[Point] = []
        while self._decided and self._decided[0][0] <= until:
            found.append(self._decided.popleft())
        return found

    def _has_arrived(self) -> bool:
        if self._end is None or not self._is_at(self._home):
            return False
        return self._time >= self._end - 1e-9

    def _is_at(self, place: float) -> bool:
        return abs(self._place - place) <= SAME and self._velocity == 0

    def _is_near(self, place: float) -> bool:
        return abs(place - self._place) < SHORTEST

    @property
    def _left(self) -> float:
        """Seconds until the body must be back."""
        return self._known + (self._overrun if self._end is None else 0.0) - self._time

    @property
    def _cruise(self) -> float:
        return (self._animation.min_speed + self._animation.max_speed) / 2

    def _decide(self, until: float) -> None:
        """One motion, or one stretch of standing still."""
        speed = float(self._random.uniform(self._animation.min_speed, self._animation.max_speed))
        target = self._pick(speed)
        if self._velocity:
            self._go_on(target)
        elif target is not None:
            self._pause(target, speed)
            self._go(target, speed)
        elif self._is_at(self._home):
            self._hold((until if self._end is None else self._end) - self._time)
        else:
            self._return(until, speed)

    def _pick(self, speed: float) -> float | None:
        """Where to go: an action from which the rest can be reached in time; else the rest loop."""
        if self._wanted is not None and not self._velocity and self._is_near(self._wanted):
            self._wanted = None
        if self._wanted is not None and self._fits(self._wanted, speed):
            place, self._wanted = self._wanted, None
            return place
        if self._wanted is not None and self._velocity * (self._wanted - self._place) < 0:
            return None  # it lies behind: turn at the next place where that may be
        places = [place for place in self._actions if self._fits(place, speed)]
        if places:
            weights = np.array([self._weight(place) for place in places])
            return places[self._random.choice(len(places), p=weights / weights.sum())]
        if self._gestures and self._is_at(self._home) and self._fits(self._back, speed):
            return self._back
        return None

    def _weight(self, place: float) -> float:
        again = AGAIN if abs(place - self._before) <= SAME else 1.0
        return again * (0.05 + self._actions[place])

    def _fits(self, place: float, speed: float) -> bool:
        way = place - self._place
        if self._is_near(place) or self._velocity * way < 0:
            return False
        there = travel(abs(way), self._first_speed or speed, 1 if self._velocity else 2)
        return there + travel(abs(self._home - place), self._cruise) <= self._left

    @property
    def _first_speed(self) -> float:
        """Speed at which the plan begins: within the limits, 0 if the body stands still."""
        if self._velocity == 0:
            return 0.0
        return min(max(abs(self._velocity), self._animation.min_speed), self._animation.max_speed)

    def _go_on(self, target: float | None) -> None:
        """A body in motion goes on; where nothing lies ahead, it stops at once."""
        if target is None:
            ahead = [place - self._place for place in self._turns]
            ahead = [way for way in ahead if way * self._velocity > 0 and abs(way) > SAME]
            target = self._place + min(ahead, key=abs) if ahead else None
        if target is None:
            self._velocity = 0.0
        else:
            self._go(target, self._first_speed)

    def _pause(self, target: float, speed: float) -> None:
        """Holds the pose for a moment, if there is one to spare."""
        pause = max(0.0, float(self._random.uniform(-PAUSE, PAUSE)))
        there = travel(abs(target - self._place), speed)
        home = travel(abs(self._home - target), self._cruise)
        self._hold(min(pause, self._left - there - home))

    def _return(self, until: float, speed: float) -> None:
        """Goes back to the end of the rest loop, or waits while sound may come."""
        way = abs(self._home - self._place)
        slowest, fastest = (
            travel(way, limit) for limit in (self._animation.min_speed, self._animation.max_speed)
        )
        spare = self._left - travel(way, self._cruise)
        if spare > LINGER:
            self._go(self._home, speed if travel(way, speed) <= self._left else self._cruise)
        elif self._end is None and spare > SAME:
            self._hold(min(until - self._time, spare))
        else:
            self._hold(self._left - slowest)
            self._go(self._home, speed_for(way, min(max(self._left, fastest), slowest)))

    def _hold(self, seconds: float) -> None:
        if seconds > 0:
            self._time += seconds
            self._decided.append((self._time, self._place))

    def _go(self, target: float, speed: float) -> None:
        """Moves to a place, faster at first and slower at last."""
        way, moving = target - self._place, self._velocity != 0
        for seconds, part in leg(abs(way), speed, moving):
            self._decided.append((self._time + seconds, self._place + math.copysign(part, way)))
        self._time = self._decided[-1][0]
        self._before, self._place, self._velocity = self._place, target, 0.0


def ease_seconds(way: float, speed: float, eased: int) -> float:
    """Duration in seconds of each acceleration: `EASE`, or less for a short way."""
    return min(EASE, 2 * way / (eased * speed))


def travel(way: float, speed: float, eased: int = 2) -> float:
    """Duration in seconds of a motion.

    Args:
        way: Distance in body seconds.
        speed: Speed in the middle, body seconds per second.
        eased: Number of the motion's ends at which the body stands still.
    """
    return way / speed + eased * ease_seconds(way, speed, eased) / 2


def speed_for(way: float, seconds: float) -> float:
    """Speed in the middle of a motion that takes `seconds`; the inverse of `travel`."""
    return way / (seconds - EASE) if seconds >= 2 * EASE else 2 * way / seconds


def leg(way: float, speed: float, moving: bool) -> list[Point]:
    """A motion from 0 to `way`, as points (seconds, body seconds) relative to its beginning.

    Args:
        way: Distance in body seconds, above 0.
        speed: Speed in the middle, body seconds per second.
        moving: Whether the motion begins at full speed instead of from standing still.
    """
    ease = ease_seconds(way, speed, 1 if moving else 2)
    ramp = [(ease * i / RAMP, speed * ease * (i / RAMP) ** 2 / 2) for i in range(1, RAMP + 1)]
    points = [] if moving else list(ramp)
    at, place = points[-1] if points else (0.0, 0.0)
    end = travel(way, speed, 1 if moving else 2)
    steady = end - ease - at
    count = min(math.ceil(steady / STEP), MOST_POINTS) if steady > 1e-9 else 0
    for i in range(1, count + 1):
        points.append((at + steady * i / count, place + speed * steady * i / count))
    ending = [(end - seconds, way - part) for seconds, part in [(0.0, 0.0), *ramp[:-1]]]
    return points + ending[::-1]
