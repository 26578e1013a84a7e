"""Estimates how far the page has played an utterance, and when more may be sent."""

from ico3d.chat.wire.protocol import MAX_AHEAD_SECONDS, SPEECH_RATE


class Playback:
    """The page's position in an utterance, estimated between its `clock` messages.

    All times are seconds on one monotonic clock that the caller reads.
    """

    def __init__(self):
        """Starts without an utterance."""
        self.utterance = -1
        self._sent = 0.0  # s of the utterance that the page has
        self._position = 0.0  # s, where it was at `_at`
        self._at: float | None = None
        self._held = False

    def begin(self, utterance: int) -> None:
        """Sets the current utterance, which starts to play when its first piece is sent."""
        self.utterance, self._sent, self._position, self._at = utterance, 0.0, 0.0, None

    def sent(self, end_sample: int, now: float) -> None:
        """Registers that sound up to sample `end_sample` was sent."""
        if self._at is None:
            self._at = now
        self._sent = end_sample / SPEECH_RATE

    def clock(self, utterance: int, position: float, now: float) -> None:
        """Takes a report of the page; positions that it cannot have reached are limited."""
        if utterance == self.utterance and self._at is not None:
            self._position, self._at = min(position, self._sent), now

    def hold(self, now: float) -> None:
        """Stops the estimate until the page's next report, because the connection was lost."""
        self._position = self.position(now)
        self._held = True

    def release(self, now: float) -> None:
        """Resumes, because the page has reconnected."""
        self._held = False
        if self._at is not None:
            self._at = now

    def position(self, now: float) -> float:
        """Seconds of the utterance that have been heard; at most what was sent."""
        if self._at is None or self._held:
            return self._position
        return min(self._sent, self._position + max(0.0, now - self._at))

    def wait_to_send(self, end_sample: int, now: float) -> float:
        """Seconds until a piece that ends at `end_sample` may be sent."""
        return end_sample / SPEECH_RATE - MAX_AHEAD_SECONDS - self.position(now)

    def remaining(self, now: float) -> float:
        """Seconds of sent sound that have not been heard yet."""
        return self._sent - self.position(now)
