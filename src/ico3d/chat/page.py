"""The visitor's page as the conversation sees it: a receiver of messages.

A page outlives its connection: messages that were lost are sent again after it reconnects.
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
    """Queue of messages for one connection."""

    def __init__(self):
        """Starts empty and open."""
        self._waiting: deque[ServerMessage] = deque()
        self._filled = asyncio.Event()
        self._closed = False

    def put(self, message: ServerMessage) -> None:
        """Adds a message; closes the outbox if the page does not read its messages."""
        if len(self._waiting) >= MAX_WAITING:
            self.close()
        if not self._closed:
            self._waiting.append(message)
        self._filled.set()

    async def get(self) -> ServerMessage | None:
        """Waits for the next message; None if the outbox is closed and empty."""
        while not self._waiting:
            if self._closed:
                return None
            self._filled.clear()
            await self._filled.wait()
        return self._waiting.popleft()

    def drop(self, utterance: int) -> None:
        """Removes the messages of an utterance."""
        kept = [message for message in self._waiting if _utterance_of(message) != utterance]
        self._waiting = deque(kept)

    @property
    def is_closed(self) -> bool:
        """Whether the connection is to end."""
        return self._closed

    def close(self) -> None:
        """Closes the outbox; messages in it are still delivered."""
        self._closed = True
        self._filled.set()


class Page:
    """Sends messages to the page's current connection."""

    def __init__(self):
        """Starts idle and without a connection."""
        self._outbox: Outbox | None = None
        self._log: deque[ServerMessage] = deque(maxlen=KEPT)
        self._next_index = 0
        self._state = State("idle")

    def attach(self, outbox: Outbox) -> None:
        """Sets the page's connection and closes an earlier one."""
        if self._outbox is not None:
            self._outbox.close()
        self._outbox = outbox

    def detach(self, outbox: Outbox) -> bool:
        """Removes a connection that has closed; returns whether it was the page's."""
        if self._outbox is not outbox:
            return False
        self._outbox = None
        return True

    def end(self, last: ServerMessage) -> None:
        """Sends a last message and closes the connection, if there is one."""
        self._put(last)
        if self._outbox is not None:
            self._outbox.close()

    @property
    def is_attached(self) -> bool:
        """Whether the page has a connection."""
        return self._outbox is not None

    @property
    def state(self) -> str:
        """The state that the page was last told."""
        return self._state.state

    def replay(self, last_index: int) -> None:
        """Sends again all messages after the speech message `last_index`, and the state."""
        log = list(self._log)
        known = [isinstance(m, Speech) and m.index <= last_index for m in log]
        after = len(log) - known[::-1].index(True) if any(known) else 0
        for message in [*log[after:], self._state]:
            self._put(message)

    def send(self, message: ServerMessage) -> None:
        """Sends a message, or keeps it until the page reconnects."""
        if isinstance(message, Stop):
            self._forget(message.utterance)
        final = isinstance(message, Transcript) and message.final
        if final or _utterance_of(message) is not None:
            self._log.append(message)
        self._put(message)

    def send_speech(self, frame: SpeechFrame) -> None:
        """Sends a piece of speech with the session's next index."""
        index, self._next_index = self._next_index, self._next_index + 1
        rows = np.clip(frame.expressions, -HALF, HALF).astype(np.float16)  # (rows, B)
        first = (frame.first_sample, frame.first_expression)
        self.send(Speech(frame.utterance, index, *first, frame.pcm, rows))

    def show(self, state: str) -> None:
        """Sends the state if it has changed."""
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
