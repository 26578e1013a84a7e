"""WebSockets whose control frames and fragments are bounded, as their messages are elsewhere.

uvicorn answers every ping, keeps every piece of a message that does not end, parses what it has
read although nobody takes the messages, and waits for ever until a peer has read the last word.
"""

import asyncio
import contextlib
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode, Frame

from ico3d.chat.bucket import Bucket
from ico3d.chat.serving.crowd import GONE, MOST_SOCKETS, Crowd, peer_of
from ico3d.chat.wire.protocol import MAX_BURST, MAX_RATE

SLICE = 1 << 11  # bytes that are parsed at once: of frames of six bytes, some hundred
RATE, AT_ONCE = MAX_RATE, 2 * MAX_BURST
"""Pings, pongs and continuations of a second, and at once: each message may come in two pieces."""
LARGEST_BACKLOG = 1 << 20  # bytes that a peer may leave unread
LAST_WORDS = 5.0  # s in which a peer may read what was sent before the connection was closed
LATE = 1 << 12  # bytes that are parsed after the last word, which may have crossed them
FAREWELL = 2.0  # s in which a peer may answer that the connection is closed, or read a refusal
PARTING = 0.2  # s in which one that broke the rules may read why


_lines = Crowd(2 * MOST_SOCKETS)
"""Connections of each machine that are WebSockets, those that are refused or closed included until
they are gone."""


class BoundedWebSocket(WebSocketsSansIOProtocol):
    """One WebSocket, which is closed if its peer sends too many frames or does not read."""

    def __init__(self, *given: Any, **named: Any):
        """Takes what uvicorn gives to a connection."""
        super().__init__(*given, **named)
        self.close_timeout = FAREWELL
        self._place, self._gone = contextlib.ExitStack(), self.loop.create_future()
        self._allowed = Bucket(RATE, AT_ONCE, self.loop.time)
        self._unparsed = memoryview(b"")  # came with messages that are not taken yet
        self._look: asyncio.TimerHandle | None = None
        self._farewell: asyncio.TimerHandle | None = None
        self._late = 0  # bytes that were parsed after the last word

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Opens the connection, or closes it if its machine has too many."""
        super().connection_made(transport)
        self._look_later(closing=False)
        if not self._place.enter_context(_lines.one_more(peer_of(self.client, self.app))):
            self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forgets the connection."""
        if self._look is not None:
            self._look.cancel()
        self._unparsed, self.frames = memoryview(b""), []
        if self._farewell is not None:
            self._farewell.cancel()
        self._place.close()
        self._gone.set_result(None)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Takes bytes: as many as make a message, the rest once it is taken."""
        if self._late > LATE:
            return
        self._unparsed = memoryview(bytes(self._unparsed) + data if self._unparsed else data)
        self._parse()

    async def run_asgi(self) -> None:
        """Serves the connection, which is ended a while after it was closed or refused."""
        scope: Any = self.scope  # of whose keys some are uvicorn's
        scope[GONE] = self._gone
        await super().run_asgi()
        if not self._gone.done():  # else nothing would let go of it meanwhile
            self._farewell = self.loop.call_later(FAREWELL, self._end_if_read)

    async def receive(self) -> Any:
        """Returns the next message or the end of the connection."""
        message = await super().receive()
        self._parse()
        return message

    async def send(self, message: Any) -> None:
        """Sends a message or closes the connection, after which nothing that came is kept back."""
        await super().send(message)
        self._parse()

    def handle_ping(self) -> None:
        """Answers a ping."""
        if self._may_come():
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        """Takes the answer to a ping."""
        if self._may_come():
            super().handle_pong(event)

    def handle_cont(self, event: Frame) -> None:
        """Takes a further piece of a message."""
        if self._may_come():
            super().handle_cont(event)

    def handle_parser_exception(self) -> None:
        """Closes the connection of a peer that broke the rules.

        By HTTPS it would be heard and decrypted until it agrees that the connection is closed.
        """
        super().handle_parser_exception()
        self.loop.call_later(PARTING, self.transport.abort)

    def _parse(self) -> None:
        """Parses what has come, until there is a message."""
        while self._unparsed and not self.read_paused and not self.transport.is_closing():
            piece, self._unparsed = self._unparsed[:SLICE], self._unparsed[SLICE:]
            if not self._unparsed:
                self._unparsed = memoryview(b"")  # a view of nothing would keep all that came
            if self.close_sent:
                self._count_late(len(piece))
            super().data_received(bytes(piece))
            unread = self.transport.get_write_buffer_size() > LARGEST_BACKLOG
            if unread or self._is_no_handshake():
                self.transport.abort()

    def _count_late(self, size: int) -> None:
        """Counts what comes after the last word; of who goes on, no more is heard.

        Nothing takes messages then, so that nothing would pause their parsing.
        """
        self._late += size
        if self._late > LATE:
            self._unparsed = memoryview(b"")
            self.loop.call_later(PARTING, self.transport.abort)

    def _is_no_handshake(self) -> bool:
        """Whether the head was none that websockets reads, after which uvicorn waits for ever."""
        return self.conn.handshake_exc is not None and not self.handshake_initiated

    def _may_come(self) -> bool:
        """Counts a frame; if there are too many, closes the connection and says so."""
        if self.transport.is_closing():
            return False
        if self._allowed.take(1):
            return True
        self.conn.fail(
            CloseCode.POLICY_VIOLATION, f"more than {RATE} control frames and fragments per second."
        )
        self.handle_parser_exception()
        return False

    def _end_if_read(self) -> None:
        """Ends a connection whose peer has read the last word, and does not answer it."""
        if not self.transport.get_write_buffer_size():
            self.transport.abort()

    def _look_later(self, closing: bool) -> None:
        self._look = self.loop.call_later(LAST_WORDS, self._end_if_left, closing)

    def _end_if_left(self, was_closing: bool) -> None:
        """Ends a connection that was closed a while ago, and whose peer does not read."""
        if was_closing:
            self.transport.abort()
        else:
            self._look_later(self.transport.is_closing())
