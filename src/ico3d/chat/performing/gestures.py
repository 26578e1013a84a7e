"""The body's motion while the avatar speaks: plans it as sound arrives, and tells the page."""

import numpy as np

from ico3d.bundle.animation import Animation
from ico3d.bundle.planner import Planner, Point, Start
from ico3d.chat.frames import Utterances
from ico3d.chat.page import Page
from ico3d.chat.wire.protocol import MAX_AHEAD_SECONDS, MAX_POINTS, Clock, Timeline

LEAD = 1.5
"""Seconds of motion that the page gets beyond what is heard: decided late, it fits what comes."""
REFILL = 1.0
"""Seconds below which it gets more."""
OVERRUN = 1.0
"""Seconds that hands may take to come down after a speech that ended unexpectedly."""
APART = 0.05
"""Seconds between two reports of the page that tell how fast the body moves, at least."""
STANDING = 0.1
"""Body seconds per second below which it stands still."""


class Gestures:
    """Plans an utterance from where the page says that the body is, in which direction it moves.

    The page reports only while an utterance plays: its first two reports tell both, a moment
    after the speech began. Until then its body goes on resting.
    """

    def __init__(
        self,
        animation: Animation,
        page: Page,
        utterances: Utterances,
        moving: bool,
        seed: int,
    ):
        """The motion of one session.

        Args:
            animation: The body's key frames.
            page: Gets `Timeline`s.
            utterances: Know how much sound of an utterance there is.
            moving: False holds the body at rest while the face talks.
            seed: Decides, with the number of an utterance, everything that is random.
        """
        self._animation, self._page, self._utterances = animation, page, utterances
        self._moving, self._seed = moving, seed
        self._wanted: float | None = None  # body time of the action that was asked for
        self.stop()

    def stop(self) -> None:
        """Nothing is spoken any more: the page's body finds its way to rest by itself."""
        self._utterance: int | None = None
        self._first: tuple[float, float] | None = None  # position and body time
        self._planner: Planner | None = None
        self._planned = 0.0  # s of the utterance for which the page has motion

    @property
    def names(self) -> list[str]:
        """Gestures that can be asked for."""
        return list(self._animation.gestures) if self._moving else []

    def request(self, name: str) -> None:
        """A gesture to make next, in what is spoken now or in the utterance that follows."""
        self._wanted = self._animation.gestures[name]
        if self._planner is not None:
            self._hand_over(self._planner)

    def forget(self) -> None:
        """What was asked for is not to be made any more, and what it was for is over."""
        self._wanted = None
        self.stop()

    def _hand_over(self, planner: Planner) -> None:
        if self._wanted is not None:
            planner.visit(self._wanted)
            self._wanted = None

    def clock(self, message: Clock, position: float) -> None:
        """The page says where it is.

        Args:
            message: Of the utterance that is spoken.
            position: Seconds of it that can have been heard.
        """
        if message.utterance != self._utterance:
            self.stop()
            self._utterance = message.utterance
        if self._planner is None:
            self._planner = self._begin(position, message.body_time)
        if self._planner is not None:
            self._hand_over(self._planner)
            self._go_on(self._planner, message.utterance, position)

    def _begin(self, position: float, body_time: float) -> Planner | None:
        """A plan, once it is known how the body moves."""
        if position <= 0:
            return None
        if self._first is None:
            self._first = position, body_time
        before, place = self._first
        if position - before < APART:
            return None
        velocity = (body_time - place) / (position - before)
        start = Start(body_time, velocity if abs(velocity) >= STANDING else 0.0)
        random = np.random.default_rng([self._seed, self._utterance or 0])
        return Planner(self._animation, start, random, position, self._moving, OVERRUN)

    def _go_on(self, planner: Planner, utterance: int, position: float) -> None:
        seconds, complete = self._utterances.sound(utterance)
        if complete:
            planner.end(seconds)
        else:
            planner.know(seconds)
        if complete and seconds - position <= MAX_AHEAD_SECONDS:
            self._send(utterance, planner.points())
        elif self._planned < position + REFILL:
            self._send(utterance, planner.points(position + LEAD))

    def _send(self, utterance: int, points: list[Point]) -> None:
        for first in range(0, len(points), MAX_POINTS):
            rounded = [(round(t, 4), round(b, 4)) for t, b in points[first : first + MAX_POINTS]]
            self._planned = rounded[-1][0]
            self._page.send(Timeline(utterance, rounded))
