"""HTTP for MCP servers, whose answers cannot fill the memory. Imported only where mcp is."""

from collections.abc import AsyncIterator

import httpx2

MOST_BYTES = 4 << 20
"""Of an answer, which may be the list of all functions."""
EVENTS = "text/event-stream"


class BoundedTransport(httpx2.AsyncHTTPTransport):
    """Reads no more of an answer than `MOST_BYTES`, and none that is compressed.

    A stream of events may go on for long: the SDK bounds each of them.
    """

    async def handle_async_request(self, request: httpx2.Request) -> httpx2.Response:
        """Sends a request.

        Raises:
            ReadError: If the answer is compressed; while it is read, if it is large.
        """
        request.headers["Accept-Encoding"] = "identity"
        response = await super().handle_async_request(request)
        if response.headers.get("Content-Encoding", "identity") != "identity":
            await response.aclose()
            raise httpx2.ReadError("its answer is compressed")
        if not response.headers.get("Content-Type", "").startswith(EVENTS):
            response.stream = _Bounded(response.stream)
        return response


class _Bounded(httpx2.AsyncByteStream):
    """The bytes of an answer, up to `MOST_BYTES`."""

    def __init__(self, stream: httpx2.SyncByteStream | httpx2.AsyncByteStream):
        assert isinstance(stream, httpx2.AsyncByteStream)
        self._stream = stream

    async def __aiter__(self) -> AsyncIterator[bytes]:
        size = 0
        async for piece in self._stream:
            size += len(piece)
            if size > MOST_BYTES:
                raise httpx2.ReadError(f"its answer has more than {MOST_BYTES} bytes")
            yield piece

    async def aclose(self) -> None:
        await self._stream.aclose()
