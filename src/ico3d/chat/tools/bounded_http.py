"""HTTP for MCP servers, whose answers cannot fill the memory. Imported only where mcp is."""

import asyncio
import time
from collections.abc import AsyncIterator

import httpx2

from ico3d.chat.bucket import Bucket
from ico3d.chat.services.bounded import (
    Events,
    Limits,
    Whole,
    Wrapped,
    ask_plain,
    ensure_plain,
    is_events,
    taking_turns,
)
from ico3d.chat.services.tls import client_context

MESSAGE = Limits(1 << 20, 8_000)
"""Bytes and parts of an answer, which may be the list of all functions.

Of each part that does not fit the protocol the SDK makes several errors, of 20 kB in all.
"""
ENDING = 2.0
"""Seconds in which a server may answer that a session ends."""
BYTE_RATE, BYTES_AT_ONCE = 256e3, 8e6
"""Bytes of a server's events per second for long, and at once: what it asks of a client is kept
until that is answered."""
LINE_RATE, LINES_AT_ONCE = 200.0, 4000.0
"""Lines of a server's events per second for long, and at once: each costs the loop of all visitors
time. An event has three or four."""
STREAM_RATE, STREAMS_AT_ONCE = 1.0, 10.0
"""Requests per second for long, and at once, by which the SDK opens and resumes streams: where a
server says so (`retry: 0`), it does that again without a pause."""
MOST_WAITING = 10
"""Streams that wait to be opened: one of a call that was answered on another is never needed."""


class BoundedTransport(httpx2.AsyncHTTPTransport):
    """Reads no more of an answer than `MESSAGE`, and none that is compressed.

    A stream of events may go on for long: each is a message, and no more than `LINE_RATE` come.
    What is no success is none, whatever its type says: the SDK keeps a redirect's body whole.
    What opens streams anew waits if that is too soon, and fails where many wait; calls, which
    are sent by POST, do not. What ends a session is answered within `ENDING`, or not at all.
    """

    def __init__(self, seconds: float, trust_env: bool = True):
        """Connects.

        Args:
            seconds: Longest silence of an answer to what is sent.
            trust_env: Whether proxies are used that the environment names.
        """
        super().__init__(verify=client_context(trust_env), trust_env=trust_env)
        self._seconds = seconds
        self._bytes = Bucket(BYTE_RATE, BYTES_AT_ONCE, time.monotonic)
        self._lines = Bucket(LINE_RATE, LINES_AT_ONCE, time.monotonic)  # of all streams
        self._streams = Bucket(STREAM_RATE, STREAMS_AT_ONCE, time.monotonic)
        self._waiting = 0

    async def handle_async_request(self, request: httpx2.Request) -> httpx2.Response:
        """Sends a request.

        Raises:
            ReadError: If the answer is compressed, or too many streams wait; while it is read, if
                it is large or has too many events.
        """
        await ask_plain(request)
        if request.method == "GET":
            await self._take_turn()
        if request.method == "POST":
            waits = dict(request.extensions.get("timeout", {}))
            request.extensions = {**request.extensions, "timeout": waits | {"read": self._seconds}}
        if request.method == "DELETE":
            return await self._ended(request)
        response = await super().handle_async_request(request)
        await ensure_plain(response)
        stream = response.stream
        if response.is_success and is_events(response):
            response.stream = _Paced(stream, self._lines, self._bytes)
        else:
            response.stream = Whole(stream, MESSAGE)
        return response

    async def _take_turn(self) -> None:
        if self._waiting >= MOST_WAITING:
            raise httpx2.ReadError("it ends too many streams")
        self._waiting += 1
        try:
            while not self._streams.take(1):
                await asyncio.sleep(1 / STREAM_RATE)
        finally:
            self._waiting -= 1

    async def _ended(self, request: httpx2.Request) -> httpx2.Response:
        """The answer to the end of a session, of which nobody wants more than its status."""
        try:
            async with asyncio.timeout(ENDING):
                response = await super().handle_async_request(request)
                await response.aclose()
        except TimeoutError as error:
            raise httpx2.ReadTimeout("it does not answer that a session ends") from error
        return httpx2.Response(response.status_code, request=request)


class _Paced(Wrapped):
    """The bytes of a stream of events, as long as their lines do not come too fast."""

    def __init__(
        self,
        stream: httpx2.SyncByteStream | httpx2.AsyncByteStream,
        lines: Bucket,
        amount: Bucket,
    ):
        super().__init__(stream)
        self._lines, self._amount = lines, amount

    async def __aiter__(self) -> AsyncIterator[bytes]:
        last, events = b"", Events(MESSAGE)
        async for piece in taking_turns(self._stream):
            events.add(piece)
            ends = _ends(last + piece) - _ends(last)
            if not self._lines.take(ends) or not self._amount.take(len(piece)):
                raise httpx2.ReadError("it sends too many events")
            last = piece[-1:]
            yield piece


def _ends(text: bytes) -> int:
    """Number of line ends, as streams of events may have them: one of two characters, or both."""
    return text.count(b"\n") + text.count(b"\r") - text.count(b"\r\n")
