"""Whether anybody is still there."""

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
    """Knows since when a session has neither spoken nor typed nor played.

    pipecat's own idle timer starts when the avatar falls silent and knows nothing of typing: a
    visitor whom nothing was ever said to would stay forever.
    """

    def __init__(self, now: Callable[[], float]):
        """Active now; reads the clock `now`, in seconds."""
        super().__init__(observe_every_push=False)
        self._now = now
        self._last = now()

    def touch(self) -> None:
        """Something happened that only a visitor does."""
        self._last = self._now()

    def idle_seconds(self) -> float:
        """Seconds since the last sign."""
        return self._now() - self._last

    async def on_push_frame(self, data: FramePushed):
        """Looks for voices."""
        if isinstance(data.frame, SIGNS):
            self.touch()
