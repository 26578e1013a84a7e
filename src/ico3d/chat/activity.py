"""Detects visitors who have left although their page is still open."""

from collections.abc import Callable

from pipecat.frames.frames import (
    BotStartedSpeakingFrame,
    BotStoppedSpeakingFrame,
    UserSpeakingFrame,
    VADUserStartedSpeakingFrame,
)
from pipecat.observers.base_observer import BaseObserver, FramePushed

SIGNS = (
    VADUserStartedSpeakingFrame,
    UserSpeakingFrame,
    BotStartedSpeakingFrame,
    BotStoppedSpeakingFrame,
)


class Activity(BaseObserver):
    """Measures for how long a visitor has neither spoken nor typed and nothing was played.

    pipecat's own idle timer starts when the avatar falls silent and does not know of typed
    questions. A visitor to whom nothing was ever said would stay forever.
    """

    def __init__(self, now: Callable[[], float]):
        """Starts as active; `now` returns the time in seconds."""
        super().__init__(observe_every_push=False)
        self._now = now
        self._last = now()

    def touch(self) -> None:
        """Registers a sign of activity."""
        self._last = self._now()

    def idle_seconds(self) -> float:
        """Seconds since the last sign of activity."""
        return self._now() - self._last

    async def on_push_frame(self, data: FramePushed):
        """Registers voices among the frames of the pipeline."""
        if isinstance(data.frame, SIGNS):
            self.touch()
