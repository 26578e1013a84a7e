"""Answers of OpenAI-compatible servers, which cannot fill the memory. Imported with `client`."""

from collections.abc import AsyncIterator

import httpx2

MOST_BYTES = 32 << 20
"""Of an answer: a language model's with its thoughts, or the sound of what is said at once."""
MOST_OF_ERROR = 64 << 10
"""Bytes of an answer that tells an error."""
MOST_OF_LINE = 64 << 10
"""Bytes of a line of a stream of events, which is kept until it ends.

Of 1 MB of empty objects the SDK makes 340,000 of its own, for which everybody would wait 9 s.
"""
EVENTS = "text/event-stream"
PLAIN = "identity"


async def ask_plain(request: httpx2.Request) -> None:
    """Asks for an answer without compression, in which a little becomes much."""
    request.headers["Accept-Encoding"] = PLAIN


async def ensure_plain(response: httpx2.Response) -> None:
    """Closes an answer that is compressed all the same, and has every other read as UTF-8.

    Python knows codings that take hours, and some that hide where lines end.

    Raises:
        ReadError: If it is compressed.
    """
    response.encoding = "utf-8"
    if response.headers.get("Content-Encoding", PLAIN) != PLAIN:
        await response.aclose()
        raise httpx2.ReadError("its answer is compressed")


def is_events(response: httpx2.Response) -> bool:
    """Whether an answer is a stream of events."""
    return response.headers.get("Content-Type", "").strip().lower().startswith(EVENTS)


async def bound(response: httpx2.Response, most: int | None = None) -> None:
    """Has no more of an answer read than is allowed.

    Args:
        response: The answer.
        most: Bytes that it may have; by default `MOST_BYTES`, and of an error `MOST_OF_ERROR`.

    Raises:
        ReadError: If the answer is compressed; while it is read, if it is too large.
    """
    await ensure_plain(response)
    most = most or MOST_BYTES
    most = min(most, MOST_OF_ERROR) if response.is_error else most
    response.stream = _Bounded(response.stream, is_events(response), most)


class Wrapped(httpx2.AsyncByteStream):
    """The bytes of an answer; how many, those say that are made of it."""

    def __init__(self, stream: httpx2.SyncByteStream | httpx2.AsyncByteStream):
        """Takes an answer's own bytes."""
        assert isinstance(stream, httpx2.AsyncByteStream)
        self._stream = stream

    async def aclose(self) -> None:
        """Closes the answer."""
        await self._stream.aclose()


class _Bounded(Wrapped):
    """The bytes of an answer, up to `most`; of its lines, up to `MOST_OF_LINE`."""

    def __init__(
        self, stream: httpx2.SyncByteStream | httpx2.AsyncByteStream, lines: bool, most: int
    ):
        super().__init__(stream)
        self._lines, self._most = lines, most

    async def __aiter__(self) -> AsyncIterator[bytes]:
        size = line = 0
        async for piece in self._stream:
            size += len(piece)
            end = piece.rfind(b"\n")
            line = line + len(piece) if end < 0 else len(piece) - end - 1
            if size > self._most or (self._lines and line > MOST_OF_LINE):
                raise httpx2.ReadError("its answer is too large")
            yield piece
