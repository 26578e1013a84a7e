"""Plans the motion of a body of windows while sound arrives, and sends it to the page."""

import numpy as np

from ico3d.bundle.animation import Animation
from ico3d.bundle.planner import Planner, Point, Start
from ico3d.chat.frames import Utterances
from ico3d.chat.page import Page
from ico3d.chat.wire.protocol import MAX_AHEAD_SECONDS, MAX_POINTS, Clock, Timeline

LEAD = 1.5
"""Seconds of motion that the page has beyond the heard sound; small, so that decisions are late."""
REFILL = 1.0
"""Seconds of remaining motion below which the page gets more."""
OVERRUN = 1.0
"""Seconds that hands may take to come down after a speech that ended unexpectedly."""
APART = 0.05
"""Least time in seconds between two reports of the page that are used to compute a speed."""
STANDING = 0.1
"""Speed below which the body counts as standing still, body seconds per second."""


class Gestures:
    """Plans the motion of each utterance from the body's current place and direction.

    The page reports only while an utterance plays. Place and direction follow from its first two
    reports, shortly after the speech has begun; until then the body continues to rest.
    """

    def __init__(
        self,
        animation: Animation,
        page: Page,
        utterances: Utterances,
        moving: bool,
        seed: int,
    ):
        """Creates the motion of one session.

        Args:
            animation: Key frames and limits of the body's motion.
            page: Receives `Timeline`s.
            utterances: Tells how much sound of an utterance has been made.
            moving: If False, the body stays at rest while the face talks.
            seed: Together with an utterance's number, the seed of all random choices.
        """
        self._animation, self._page, self._utterances = animation, page, utterances
        self._moving, self._seed = moving, seed
        self._wanted: float | None = None  # body time of the action that was asked for
        self.stop()

    def stop(self) -> None:
        """Ends the utterance; the page returns the body to rest by itself."""
        self._utterance: int | None = None
        self._first: tuple[float, float] | None = None  # position and body time
        self._planner: Planner | None = None
        self._planned = 0.0  # s of the utterance for which the page has motion

    @property
    def names(self) -> list[str]:
        """Names of gestures that can be requested."""
        return list(self._animation.gestures) if self._moving else []

    def request(self, name: str) -> None:
        """Requests a gesture for the current utterance or, if there is none, for the next."""
        self._wanted = self._animation.gestures[name]
        if self._planner is not None:
            self._hand_over(self._planner)

    def forget(self) -> None:
        """Drops requested gestures, because their utterance is over."""
        self._wanted = None
        self.stop()

    def _hand_over(self, planner: Planner) -> None:
        if self._wanted is not None:
            planner.visit(self._wanted)
            self._wanted = None

    def clock(self, message: Clock, position: float) -> None:
        """Takes a report of the page's playback.

        Args:
            message: Report about the current utterance.
            position: Seconds of the utterance that can have been heard.
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
