"""How much a page may send."""

import time
from collections.abc import Callable

from ico3d.chat.protocol import MAX_BURST, MAX_RATE, MICROPHONE_RATE, Audio, ClientMessage
from ico3d.errors import ProtocolError

AUDIO_RATE = 1.25 * MICROPHONE_RATE  # samples per second for long: clocks differ a little
AUDIO_BURST = 5 * MICROPHONE_RATE
FORGIVEN = 5  # broken rules after which a connection is closed


class Bucket:
    """A token bucket: `rate` per second for long, `burst` at once."""

    def __init__(self, rate: float, burst: float, now: Callable[[], float]):
        """A full bucket."""
        self._rate, self._burst, self._now = rate, burst, now
        self._level, self._at = burst, now()

    def take(self, amount: float) -> bool:
        """Takes an amount if it is there."""
        now = self._now()
        self._level = min(self._burst, self._level + self._rate * (now - self._at))
        self._at = now
        if amount > self._level:
            return False
        self._level -= amount
        return True


class Limits:
    """The limits of one connection."""

    def __init__(self, now: Callable[[], float] = time.monotonic):
        """A connection that has sent nothing yet."""
        self._messages = Bucket(MAX_RATE, MAX_BURST, now)
        self._samples = Bucket(AUDIO_RATE, AUDIO_BURST, now)
        self._broken = 0

    def check_frame(self) -> None:
        """Counts a frame.

        Raises:
            ProtocolError: If there are too many.
        """
        if not self._messages.take(1):
            raise ProtocolError(f"more than {MAX_RATE} messages per second.")

    def check_message(self, message: ClientMessage) -> None:
        """Counts a message's sound.

        Raises:
            ProtocolError: If more sound comes than a microphone makes.
        """
        if isinstance(message, Audio) and not self._samples.take(len(message.pcm)):
            raise ProtocolError("more sound than a microphone makes.")

    def forgive(self) -> bool:
        """Counts a broken rule; False when it was one too many."""
        self._broken += 1
        return self._broken < FORGIVEN
