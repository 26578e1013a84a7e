"""Limits of what a page may send, and the handling of sound that arrives late."""

import time
from collections import deque
from collections.abc import Callable

from ico3d.chat.bucket import Bucket
from ico3d.chat.wire.protocol import (
    MAX_BURST,
    MAX_RATE,
    MICROPHONE_CHUNK,
    MICROPHONE_RATE,
    Audio,
    ClientMessage,
    Say,
    Talk,
    Text,
)
from ico3d.errors import ProtocolError

STALL = 60  # s for which a network may hold back what a microphone makes, and deliver it at once
AUDIO_RATE = 1.25 * MICROPHONE_RATE  # samples per second for long: clocks differ a little
QUESTIONS, AT_ONCE = 1.0, 10  # per second for long, and at once: each has a language model begin
PRESSES, PRESSES_AT_ONCE = 3.0, 30  # of the button: each begins and ends a stretch of speech
RETURNS, RETURNS_AT_ONCE = 0.5, 10  # resumptions: each has all that was missed sent again
FORGIVEN = 5  # broken rules after which a connection is closed
FORGOTTEN = 10.0  # s after which one of them is forgotten

PAUSE = 1.0  # s without sound after which a backlog may follow
CATCH_UP = 2.0  # times real time at which sound may arrive and still be used
JITTER, BACKLOG = 1.0, 0.1  # s of sound that may come at once, and that may after a pause
SETTLED = 0.2  # s of sound: how far the balance falls at most, so how soon a backlog is over
KEPT = 5.0  # s of a backlog's latest sound that are still used: a question and how it began


class SessionLimits:
    """The limits of one page; a new connection of the same session does not reset them.

    The limit for sound is generous: when a stalled network recovers, all that the microphone
    recorded meanwhile arrives at once, through no fault of the page.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic):
        """Starts a session; `now` returns the time in seconds."""
        self._texts = Bucket(MAX_RATE, MAX_BURST, now)
        self._sounds = Bucket(MAX_RATE, STALL * MICROPHONE_RATE / MICROPHONE_CHUNK, now)
        self._samples = Bucket(AUDIO_RATE, STALL * MICROPHONE_RATE, now)
        self._questions = Bucket(QUESTIONS, AT_ONCE, now)
        self._presses = Bucket(PRESSES, PRESSES_AT_ONCE, now)
        self._returns = Bucket(RETURNS, RETURNS_AT_ONCE, now)
        self._forgiveness = Bucket(1 / FORGOTTEN, FORGIVEN - 1, now)

    def come_back(self) -> bool:
        """Counts a resumption; False if there were too many in a short time."""
        return self._returns.take(1)

    def check_frame(self, frame: str | bytes) -> None:
        """Counts a frame; binary frames contain sound.

        Raises:
            ProtocolError: If there are too many frames.
        """
        if not (self._sounds if isinstance(frame, bytes) else self._texts).take(1):
            raise ProtocolError(f"more than {MAX_RATE} messages per second.")

    def check_message(self, message: ClientMessage) -> None:
        """Counts the sound of a message, typed questions, and presses of the button.

        Raises:
            ProtocolError: If more sound arrives than a microphone can record, more questions than
                somebody can type, or more presses than a hand makes.
        """
        if isinstance(message, Audio) and not self._samples.take(len(message.pcm)):
            raise ProtocolError("more sound than a microphone makes.")
        if isinstance(message, Text | Say) and not self._questions.take(1):
            raise ProtocolError("more questions than somebody can type: wait a little.")
        if isinstance(message, Talk) and message.pressed and not self._presses.take(1):
            raise ProtocolError("more presses of the button than a hand makes: wait a little.")

    def forgive(self) -> bool:
        """Counts a violation; False if there were too many in a short time."""
        return self._forgiveness.take(1)


class Inlet:
    """Passes on sound that arrives in time; of a backlog, only the latest seconds.

    Sound that a network has held back for many seconds arrives much faster than it was spoken.
    Reacting to it at once would answer the past, so it is kept until sound arrives in time again,
    and the oldest part is dropped. Only the rate of arrival tells whether sound is in time: sample
    numbers are no clock, because they stand still while the visitor's button is up.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic):
        """Starts without sound; `now` returns the time in seconds."""
        self._now, self._at = now, now()
        self._balance = BACKLOG  # s of sound that may still come at once; below 0 in a backlog
        self._waiting: deque[Audio] = deque()
        self._pressed = False

    def admit(self, message: ClientMessage) -> list[ClientMessage]:
        """Takes a message on arrival; returns the messages to handle now, in order."""
        if isinstance(message, Audio):
            return [*self.take(message)]
        if isinstance(message, Talk) and message.pressed is not self._pressed:
            self._pressed = message.pressed
            return [*self.rest(), message]  # sound that waits belongs to the button's last state
        return [message]

    def take(self, sound: Audio) -> list[Audio]:
        """Takes sound on arrival; returns the sound to handle now, in order."""
        now = self._now()
        since, self._at = now - self._at, now
        if since - seconds(sound) >= PAUSE:
            self._balance = BACKLOG
            self._waiting.clear()  # the end of an older backlog
        else:
            self._balance = min(JITTER, self._balance + CATCH_UP * since)
        self._balance = max(-SETTLED, self._balance - seconds(sound))
        self._waiting.append(sound)
        if self._balance >= 0:
            return self.rest()
        while sum(map(seconds, self._waiting)) > KEPT:
            self._waiting.popleft()
        return []

    def rest(self) -> list[Audio]:
        """Returns the sound that is still kept, to be handled before a later message."""
        rest = list(self._waiting)
        self._waiting.clear()
        return rest


def seconds(sound: Audio) -> float:
    """Duration of a message's sound in seconds."""
    return len(sound.pcm) / MICROPHONE_RATE
