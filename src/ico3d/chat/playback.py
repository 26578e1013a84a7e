"""How far the page has played an utterance, and how long speech must wait."""

from ico3d.chat.wire.protocol import MAX_AHEAD_SECONDS, SPEECH_RATE


class Playback:
    """Estimates the page's position between its `clock` messages.

    All times are seconds of one monotonic clock that the caller reads.
    """

    def __init__(self):
        """Nothing plays yet."""
        self.utterance = -1
        self._sent = 0.0  # s of the utterance that the page has
        self._position = 0.0  # s, where it was at `_at`
        self._at: float | None = None
        self._held = False

    def begin(self, utterance: int) -> None:
        """A new utterance; it starts to play with its first piece."""
        self.utterance, self._sent, self._position, self._at = utterance, 0.0, 0.0, None

    def sent(self, end_sample: int, now: float) -> None:
        """The page has the sound up to `end_sample`."""
        if self._at is None:
            self._at = now
        self._sent = end_sample / SPEECH_RATE

    def clock(self, utterance: int, position: float, now: float) -> None:
        """The page says where it is; positions it cannot have reached are cut off."""
        if utterance == self.utterance and self._at is not None:
            self._position, self._at = min(position, self._sent), now

    def hold(self, now: float) -> None:
        """The connection dropped: count no further until the page reports again."""
        self._position = self.position(now)
        self._held = True

    def release(self, now: float) -> None:
        """The page is back."""
        self._held = False
        if self._at is not None:
            self._at = now

    def position(self, now: float) -> float:
        """Seconds of the utterance already heard; never more than was sent."""
        if self._at is None or self._held:
            return self._position
        return min(self._sent, self._position + max(0.0, now - self._at))

    def wait_to_send(self, end_sample: int, now: float) -> float:
        """Seconds until a piece that ends at `end_sample` may go out."""
        return end_sample / SPEECH_RATE - MAX_AHEAD_SECONDS - self.position(now)

    def remaining(self, now: float) -> float:
        """Seconds of sent sound not yet heard."""
        return self._sent - self.position(now)
