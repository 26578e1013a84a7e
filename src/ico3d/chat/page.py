"""The visitor's page as the conversation sees it: a place to send messages to.

It outlives a connection: what the page missed is sent again when it comes back.
"""

import asyncio
from collections import deque

import numpy as np

from ico3d.chat.frames import SpeechFrame
from ico3d.chat.wire.protocol import ServerMessage, Speech, State, Stop, Transcript

KEPT = 320  # messages that can be sent again: more than 30 s of speech and motion
HALF = 65000.0  # float16 ends at 65504
MAX_WAITING = 2000  # messages a page may leave unread before its connection is given up


class Outbox:
    """Messages on their way into one connection."""

    def __init__(self):
        """Empty and open."""
        self._waiting: deque[ServerMessage] = deque()
        self._filled = asyncio.Event()
        self._closed = False

    def put(self, message: ServerMessage) -> None:
        """Adds a message; a page that does not read is given up."""
        if len(self._waiting) >= MAX_WAITING:
            self.close()
        if not self._closed:
            self._waiting.append(message)
        self._filled.set()

    async def get(self) -> ServerMessage | None:
        """The next message; None when the outbox is closed and empty."""
        while not self._waiting:
            if self._closed:
                return None
            self._filled.clear()
            await self._filled.wait()
        return self._waiting.popleft()

    def drop(self, utterance: int) -> None:
        """Forgets what belongs to an utterance."""
        kept = [message for message in self._waiting if _utterance_of(message) != utterance]
        self._waiting = deque(kept)

    @property
    def is_closed(self) -> bool:
        """Whether the connection is to end."""
        return self._closed

    def close(self) -> None:
        """Ends the connection once everything has been read."""
        self._closed = True
        self._filled.set()


class Page:
    """Sends messages to whatever connection the page has now."""

    def __init__(self):
        """A new page: idle, not connected."""
        self._outbox: Outbox | None = None
        self._log: deque[ServerMessage] = deque(maxlen=KEPT)
        self._next_index = 0
        self._state = State("idle")

    def attach(self, outbox: Outbox) -> None:
        """A connection opened; an earlier one of the same page ends."""
        if self._outbox is not None:
            self._outbox.close()
        self._outbox = outbox

    def detach(self, outbox: Outbox) -> bool:
        """A connection closed; tells whether the page is without one now."""
        if self._outbox is outbox:
            self._outbox = None
        return self._outbox is None

    def end(self, last: ServerMessage) -> None:
        """Sends a last message and ends the connection, if there is one."""
        self._put(last)
        if self._outbox is not None:
            self._outbox.close()

    @property
    def is_attached(self) -> bool:
        """Whether a connection is open."""
        return self._outbox is not None

    @property
    def state(self) -> str:
        """What the page was told last."""
        return self._state.state

    def replay(self, last_index: int) -> None:
        """Sends again what followed the speech message `last_index`, and the state."""
        log = list(self._log)
        known = [isinstance(m, Speech) and m.index <= last_index for m in log]
        after = len(log) - known[::-1].index(True) if any(known) else 0
        for message in [*log[after:], self._state]:
            self._put(message)

    def send(self, message: ServerMessage) -> None:
        """Sends a message, or keeps it for the page's return."""
        if isinstance(message, Stop):
            self._forget(message.utterance)
        final = isinstance(message, Transcript) and message.final
        if final or _utterance_of(message) is not None:
            self._log.append(message)
        self._put(message)

    def send_speech(self, frame: SpeechFrame) -> None:
        """Sends a piece of speech under the session's next index."""
        index, self._next_index = self._next_index, self._next_index + 1
        rows = np.clip(frame.expressions, -HALF, HALF).astype(np.float16)  # (rows, B)
        first = (frame.first_sample, frame.first_expression)
        self.send(Speech(frame.utterance, index, *first, frame.pcm, rows))

    def show(self, state: str) -> None:
        """Tells the state if it changed."""
        if state != self._state.state:
            self._state = State(state)  # type: ignore[arg-type]
            self._put(self._state)

    def _put(self, message: ServerMessage) -> None:
        if self._outbox is not None:
            self._outbox.put(message)

    def _forget(self, utterance: int) -> None:
        self._log = deque((m for m in self._log if _utterance_of(m) != utterance), maxlen=KEPT)
        if self._outbox is not None:
            self._outbox.drop(utterance)


def _utterance_of(message: ServerMessage) -> int | None:
    """The utterance that a message is about, if it is about one."""
    return getattr(message, "utterance", None)
