"""Answers of OpenAI-compatible servers, which cannot fill the memory. Imported with `client`."""

import asyncio
import time
from collections.abc import AsyncIterable, AsyncIterator
from dataclasses import dataclass
from http.cookiejar import CookieJar
from typing import Any

import httpx2

MOST_BYTES = 32 << 20
"""Of an answer: a language model's with its thoughts, or the sound of what is said at once."""
MOST_OF_ERROR = 64 << 10
"""Bytes of an answer that tells an error: the SDK makes objects of it, and a text of those."""
MOST_OF_EVENT = 64 << 10
"""Bytes of an event of a stream, and of an answer that is no stream."""
MOST_PARTS = 1000
MOST_OF_WHOLE = 4000
"""Objects, lists and their members of an event, and of an answer that is no stream, of which the
SDK makes objects of its own. Commas of prose count as well.

It takes up to 0.1 ms for each, during which nobody else has a turn.
"""
PART_RATE, PARTS_AT_ONCE = 10_000.0, 30_000.0
"""Parts per second of a stream for long, and at once: for long some 200 events of a model.

A faster server is read later, which nobody hears of an answer: a voice takes five words a second.
"""
BREAK = 10
"""Parts as which the end of a line counts, and a piece that the network hands over."""
SLICE = 4 << 10
"""Bytes of a stream that are handed on at once."""
TURN = 32
"""Pieces of an answer after which others have a turn."""
SOUND = "/audio/speech"
"""End of the address at which sound is asked for, which has no lines."""
STREAMED = b'"stream":true'
"""What a request for a stream of events says, whatever its answer calls itself."""
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
    """Whether an answer calls itself a stream of events."""
    return response.headers.get("Content-Type", "").strip().lower().startswith(EVENTS)


async def bound(response: httpx2.Response, most: int | None = None) -> None:
    """Has no more of an answer read than is allowed, and no faster.

    Args:
        response: The answer, with its request.
        most: Bytes that it may have; by default `MOST_BYTES`, and of an error `MOST_OF_ERROR`.

    Raises:
        ReadError: If the answer is compressed; while it is read, if it is too large.
    """
    await ensure_plain(response)
    most = most or MOST_BYTES
    request, stream = response.request, response.stream
    if not response.is_success:  # as the SDK has it: an odd status is an error
        response.stream = Whole(stream, Limits(min(most, MOST_OF_ERROR), MOST_PARTS))
    elif request.url.path.endswith(SOUND):
        response.stream = Whole(stream, Limits(most, None))
    elif asks_for_stream(request):
        response.stream = _Paced(stream, most, Limits(MOST_OF_EVENT, MOST_PARTS))
    else:
        response.stream = Whole(stream, Limits(min(most, MOST_OF_EVENT), MOST_OF_WHOLE))


def asks_for_stream(request: httpx2.Request) -> bool:
    """Whether a request asks for a stream of events."""
    is_json = request.headers.get("Content-Type", "").startswith("application/json")
    return is_json and STREAMED in request.content


class NoCookies(CookieJar):
    """Keeps no cookies: a server could send thousands with each answer, which go back to it."""

    def extract_cookies(self, response: Any, request: Any) -> None:
        """Looks at no answer."""

    def add_cookie_header(self, request: Any) -> None:
        """Adds nothing to a request."""


@dataclass(frozen=True)
class Limits:
    """How large an answer, or an event of a stream, may be.

    Attributes:
        size: Bytes.
        parts: Objects, lists and members; None for any number.
    """

    size: int
    parts: int | None


def parts_of(text: bytes) -> int:
    """Objects, lists and members in a piece of JSON; commas in its texts count as well."""
    return text.count(b"{") + text.count(b"[") + text.count(b",")


class Amount:
    """How much has come of an answer, or of an event."""

    def __init__(self, limits: Limits):
        """Nothing has come."""
        self._limits, self._size, self._parts = limits, 0, 0

    def add(self, text: bytes) -> None:
        """Adds a piece.

        Raises:
            ReadError: If that is too much.
        """
        self._size += len(text)
        most = self._limits.parts
        self._parts += parts_of(text) if most is not None else 0
        if self._size > self._limits.size or (most is not None and self._parts > most):
            raise httpx2.ReadError("its answer is too large")


class Events:
    """How much has come of the event of a stream that has not ended."""

    def __init__(self, limits: Limits):
        """Nothing has come."""
        self._limits, self._open, self._last = limits, Amount(limits), b""

    def add(self, piece: bytes) -> None:
        """Adds a piece; a blank line ends an event.

        Raises:
            ReadError: If an event is too large.
        """
        if not piece:
            return
        begun = piece[1:] if self._last == b"\r" and piece[:1] == b"\n" else piece
        text = begun.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if self._last in (b"\n", b"\r") and text[:1] == b"\n":
            self._open = Amount(self._limits)
        self._last = piece[-1:]
        first, *others = text.split(b"\n\n")
        self._open.add(first)
        for other in others:
            self._open = Amount(self._limits)
            self._open.add(other)


class Wrapped(httpx2.AsyncByteStream):
    """The bytes of an answer; how many, those say that are made of it."""

    def __init__(self, stream: httpx2.SyncByteStream | httpx2.AsyncByteStream):
        """Takes an answer's own bytes."""
        assert isinstance(stream, httpx2.AsyncByteStream)
        self._stream = stream

    async def aclose(self) -> None:
        """Closes the answer."""
        await self._stream.aclose()


async def taking_turns(stream: AsyncIterable[bytes]) -> AsyncIterator[bytes]:
    """The pieces of an answer; others have a turn in between.

    One read of the network may hold ten thousand pieces of a byte.
    """
    count = 0
    async for piece in stream:
        count += 1
        if count % TURN == 0:
            await asyncio.sleep(0)
        yield piece


class Whole(Wrapped):
    """The bytes of an answer that is made something of when all has come."""

    def __init__(self, stream: httpx2.SyncByteStream | httpx2.AsyncByteStream, limits: Limits):
        """Takes an answer's own bytes, and how many it may have."""
        super().__init__(stream)
        self._limits = limits

    async def __aiter__(self) -> AsyncIterator[bytes]:
        """Yields its pieces.

        Raises:
            ReadError: If there are too many.
        """
        amount = Amount(self._limits)
        async for piece in taking_turns(self._stream):
            amount.add(piece)
            yield piece


class _Paced(Wrapped):
    """The bytes of a stream of events, no faster than `PART_RATE`."""

    def __init__(
        self, stream: httpx2.SyncByteStream | httpx2.AsyncByteStream, most: int, limits: Limits
    ):
        super().__init__(stream)
        self._most, self._limits = most, limits

    async def __aiter__(self) -> AsyncIterator[bytes]:
        amount, events = Amount(Limits(self._most, None)), Events(self._limits)
        ahead, seen = 0.0, time.monotonic()
        async for piece in self._stream:
            amount.add(piece)
            for start in range(0, len(piece), SLICE):
                part = piece[start : start + SLICE]
                events.add(part)
                now = time.monotonic()
                ahead = max(0.0, ahead - (now - seen) * PART_RATE) + cost_of(part)
                seen = now
                await asyncio.sleep(max(0.0, ahead - PARTS_AT_ONCE) / PART_RATE)
                yield part


def cost_of(piece: bytes) -> int:
    """Parts as which a piece of a stream counts."""
    return parts_of(piece) + BREAK * (1 + piece.count(b"\n") + piece.count(b"\r"))
