"""Limits of what a page may send, and the handling of sound that arrives late."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ico3d.chat.bucket import Bucket
from ico3d.chat.serving.crowd import Meters
from ico3d.chat.wire.protocol import (
    MAX_BURST,
    MAX_RATE,
    MICROPHONE_CHUNK,
    MICROPHONE_RATE,
    Audio,
    ClientMessage,
    Deaf,
    Heard,
    Interrupt,
    Say,
    Talk,
    Text,
)
from ico3d.errors import ProtocolError

STALL = 60  # s for which a network may hold back what a microphone makes, and deliver it at once
AUDIO_RATE = 1.25 * MICROPHONE_RATE  # samples per second for long: clocks differ a little
PACE, AT_PACE = 50, 64  # pieces of sound that are looked at as they come, of one page
QUESTIONS, AT_ONCE = 1.0, 10  # per second for long, and at once: each has a language model begin
PRESSES, PRESSES_AT_ONCE = 3.0, 30  # of a button: each goes through the whole pipeline
WORDS, WORDS_AT_ONCE = 20.0, 200  # what a browser has recognised so far: several in a word
RETURNS, RETURNS_AT_ONCE = 0.5, 10  # resumptions: each has all that was missed sent again
FORGIVEN = 5  # broken rules after which a connection is closed
FORGOTTEN = 10.0  # s after which one of them is forgotten

PAUSE = 1.0  # s without sound after which a backlog may follow
CATCH_UP = 2.0  # times real time at which sound may arrive and still be used
JITTER, BACKLOG = 1.0, 0.1  # s of sound that may come at once, and that may after a pause
SETTLED = 0.2  # s of sound: how far the balance falls at most, so how soon a backlog is over
LATE = 250  # pieces of backlogs looked at in one second, of all pages: a tenth of a core
HANDLED = 1.05  # s of sound handled in one second for long, of one page
BACKLOGS = 4.0  # s of backlogs handled in one second, of a machine's pages: a third of a core
PATIENCE = 2.0  # s that they take at most
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
        self._pace = Bucket(PACE, AT_PACE, now)
        self._samples = Bucket(AUDIO_RATE, STALL * MICROPHONE_RATE, now)
        self._questions = Bucket(QUESTIONS, AT_ONCE, now)
        self._presses = Bucket(PRESSES, PRESSES_AT_ONCE, now)
        self._stops = Bucket(PRESSES, PRESSES_AT_ONCE, now)
        self._words = Bucket(WORDS, WORDS_AT_ONCE, now)
        self._returns = Bucket(RETURNS, RETURNS_AT_ONCE, now)
        self._forgiveness = Bucket(1 / FORGOTTEN, FORGIVEN - 1, now)

    def come_back(self) -> bool:
        """Counts a resumption; False if there were too many in a short time."""
        return self._returns.take(1)

    def is_late(self, frame: str | bytes) -> bool:
        """Whether a frame belongs to a backlog: a page records 31 pieces of sound in a second."""
        return isinstance(frame, bytes) and not self._pace.take(1)

    def check_frame(self, frame: str | bytes) -> None:
        """Counts a frame; binary frames contain sound.

        Raises:
            ProtocolError: If there are too many frames.
        """
        if not (self._sounds if isinstance(frame, bytes) else self._texts).take(1):
            raise ProtocolError(f"more than {MAX_RATE} messages per second.")

    def check_message(self, message: ClientMessage) -> None:
        """Counts sound, words, typed questions, and presses of the buttons to talk and to stop.

        Raises:
            ProtocolError: If more sound arrives than a microphone can record, more words than a
                browser recognises, more questions than somebody can type, or more presses than a
                hand makes.
        """
        if isinstance(message, Audio) and not self._samples.take(len(message.pcm)):
            raise ProtocolError("more sound than a microphone makes.")
        if isinstance(message, Text | Say) and not self._questions.take(1):
            raise ProtocolError("more questions than somebody can type: wait a little.")
        if isinstance(message, Talk) and message.pressed and not self._presses.take(1):
            raise ProtocolError("more presses of the button than a hand makes: wait a little.")
        if isinstance(message, Interrupt) and not self._stops.take(1):
            raise ProtocolError("more interruptions than a hand makes: wait a little.")
        if isinstance(message, Heard | Deaf) and not self._words.take(1):
            raise ProtocolError("more words than somebody can say: wait a little.")

    def forgive(self) -> bool:
        """Counts a violation; False if there were too many in a short time."""
        return self._forgiveness.take(1)


class Backlogs:
    """How fast pages catch up with what networks have held back, a minute of sound at most.

    What others' answers would wait for is spread over time. Pages of one machine wait for each
    other and for nobody else, and no longer than `PATIENCE`: behind the sound there are questions.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic):
        """Starts with nothing held back; `now` returns the time in seconds."""
        self._pieces = Bucket(LATE, LATE, now)
        self._seconds = Meters(BACKLOGS, JITTER, now)

    def before_a_look(self) -> float:
        """Seconds to wait before a piece that `is_late` is looked at: all take turns."""
        return self._pieces.owe(1)

    def pauses(self, machine: str, due: list[ClientMessage]) -> Iterator[float]:
        """The seconds to wait after each message of a page, of which the first ones have waited.

        Args:
            machine: Whose page it is; empty if unknown.
            due: What is handled now.
        """
        left = PATIENCE
        for message in due:
            pause = 0.0
            if isinstance(message, Audio) and len(due) > 1:
                owed = [bucket.owe(seconds(message)) for bucket in self._seconds.of(machine)]
                pause = min(left, *owed) if owed else 0.0
            left -= pause
            yield pause


class Inlet:
    """Passes on sound that arrives in time; of a backlog, only the latest seconds.

    Sound that a network has held back for many seconds arrives much faster than it was spoken.
    Reacting to it at once would answer the past, so it is kept until sound arrives in time again,
    and the oldest part is dropped. Only the rate of arrival tells whether sound is in time: sample
    numbers are no clock, because they stand still while the visitor's button is up.

    Pieces shorter than a page sends are put together: handling one takes 1 ms however short it is.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic):
        """Starts without sound; `now` returns the time in seconds."""
        self._now, self._at = now, now()
        self._balance = BACKLOG  # s of sound that may still come at once; below 0 in a backlog
        self._waiting: deque[Audio] = deque()
        self._handled = Bucket(HANDLED, KEPT + JITTER, now)  # s of sound
        self._short: list[Audio] = []  # pieces that together are still too short to be handled
        self._pressed = False

    def admit(self, message: ClientMessage) -> list[ClientMessage]:
        """Takes a message on arrival; returns the messages to handle now, in order."""
        if isinstance(message, Audio):
            return [*self.take(message)]
        if not isinstance(message, Talk):
            return [message]
        if message.pressed is self._pressed:
            return []
        self._pressed = message.pressed
        return [*self.rest(), message]  # sound that waits belongs to the button's last state

    def take(self, sound: Audio) -> list[Audio]:
        """Takes sound on arrival; returns the sound to handle now, in order."""
        if not len(sound.pcm):
            return []
        self._short.append(sound)
        if sum(len(piece.pcm) for piece in self._short) < MICROPHONE_CHUNK:
            return []
        sound = self._joined()
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
        if self._short:
            self._waiting.append(self._joined())
        rest = [sound for sound in reversed(self._waiting) if self._handled.take(seconds(sound))]
        self._waiting.clear()
        return rest[::-1]

    def _joined(self) -> Audio:
        """One message of the short pieces; it knows what played at its own last sample."""
        pieces, self._short = self._short, []
        if len(pieces) == 1:
            return pieces[0]
        pcm = np.concatenate([piece.pcm for piece in pieces])
        return replace(pieces[-1], sample=pieces[0].sample, pcm=pcm)


def seconds(sound: Audio) -> float:
    """Duration of a message's sound in seconds."""
    return len(sound.pcm) / MICROPHONE_RATE
