"""HTTP for MCP servers, whose answers cannot fill the memory. Imported only where mcp is."""

import asyncio
import time
from collections.abc import AsyncIterator

import httpx2

from ico3d.chat.services.bounded import Wrapped, ask_plain, ensure_plain, is_events
from ico3d.chat.supervision.allowance import Bucket

MOST_BYTES = 4 << 20
"""Of an answer, which may be the list of all functions."""
LINE_RATE, LINES_AT_ONCE = 200.0, 4000.0
"""Lines of a server's events per second for long, and at once: each costs the loop of all visitors
time. An event has three or four."""
STREAM_RATE, STREAMS_AT_ONCE = 1.0, 10.0
"""Requests per second for long, and at once, by which the SDK opens and resumes streams: where a
server says so (`retry: 0`), it does that again without a pause."""


class BoundedTransport(httpx2.AsyncHTTPTransport):
    """Reads no more of an answer than `MOST_BYTES`, and none that is compressed.

    A stream of events may go on for long: the SDK bounds each of them, and this their number. What
    opens streams anew waits if that is too soon; calls, which are sent by POST, do not.
    """

    def __init__(self, trust_env: bool = True):
        """Connects; proxies that the environment names are used if that is trusted."""
        super().__init__(trust_env=trust_env)
        self._lines = Bucket(LINE_RATE, LINES_AT_ONCE, time.monotonic)  # of all streams
        self._streams = Bucket(STREAM_RATE, STREAMS_AT_ONCE, time.monotonic)

    async def handle_async_request(self, request: httpx2.Request) -> httpx2.Response:
        """Sends a request.

        Raises:
            ReadError: If the answer is compressed; while it is read, if it is large or has too many
                events.
        """
        await ask_plain(request)
        if request.method == "GET":
            while not self._streams.take(1):
                await asyncio.sleep(1 / STREAM_RATE)
        response = await super().handle_async_request(request)
        await ensure_plain(response)
        paced = is_events(response)
        stream = response.stream
        response.stream = _Paced(stream, self._lines) if paced else _Bounded(stream)
        return response


class _Bounded(Wrapped):
    """The bytes of an answer, up to `MOST_BYTES`."""

    async def __aiter__(self) -> AsyncIterator[bytes]:
        size = 0
        async for piece in self._stream:
            size += len(piece)
            if size > MOST_BYTES:
                raise httpx2.ReadError(f"its answer has more than {MOST_BYTES} bytes")
            yield piece


class _Paced(Wrapped):
    """The bytes of a stream of events, as long as their lines do not come too fast."""

    def __init__(self, stream: httpx2.SyncByteStream | httpx2.AsyncByteStream, lines: Bucket):
        super().__init__(stream)
        self._lines = lines

    async def __aiter__(self) -> AsyncIterator[bytes]:
        last = b""
        async for piece in self._stream:
            if not self._lines.take(_ends(last + piece) - _ends(last)):
                raise httpx2.ReadError("it sends too many events")
            last = piece[-1:]
            yield piece


def _ends(text: bytes) -> int:
    """Number of line ends, as streams of events may have them: one of two characters, or both."""
    return text.count(b"\n") + text.count(b"\r") - text.count(b"\r\n")
