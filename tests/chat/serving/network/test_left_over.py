"""A body that goes on behind the answer to its request is read slowly, and not for ever."""

import asyncio
import contextlib
import time

import httpx
import pytest

from ico3d.chat.serving.network import prompt
from support.chat.serving import serving

HEAD = b"POST /nothing HTTP/1.1\r\nHost: 127.0.0.1\r\n"
CODINGS = {
    "chunks": b"Transfer-Encoding: chunked\r\n\r\n",
    "a length": b"Content-Length: 99999999999\r\n\r\n",
}
PIECE, RATE = 1 << 14, 1 << 20
SOCKETS = 8 << 20
"""Bytes that lie in the system's buffers, at most."""


@pytest.fixture
async def url(body, monkeypatch):
    """A server that reads little behind an answer."""
    monkeypatch.setattr(prompt, "LEFT_OVER", float(RATE))
    async with serving(body) as (url, _):
        yield url


async def opened(url):
    return await asyncio.open_connection("127.0.0.1", int(url.rstrip("/").rpartition(":")[2]))


async def answered(reader):
    head = await reader.readuntil(b"\r\n\r\n")
    await reader.readexactly(int(head.lower().split(b"content-length:")[1].split()[0]))
    return head


async def poured(url, coding, seconds):
    """Bytes that a server takes behind its answer within some seconds, or until it is closed."""
    reader, writer = await opened(url)
    writer.write(HEAD + CODINGS[coding])
    assert (await answered(reader)).startswith(b"HTTP/1.1 4")
    piece = bytes(PIECE)
    if coding == "chunks":
        piece = b"%x\r\n%s\r\n" % (PIECE, piece)
    sent, closed = 0, False
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            try:
                while True:
                    writer.write(piece)
                    await writer.drain()
                    sent += PIECE
            except ConnectionError:
                closed = True
    writer.transport.abort()
    return sent, closed


@pytest.mark.parametrize("coding", CODINGS)
async def test_all_connections_together_are_read_so_fast_and_no_faster(url, coding):
    begun = time.monotonic()
    taken = await asyncio.gather(*(poured(url, coding, 2.0) for _ in range(4)))
    seconds = time.monotonic() - begun
    assert sum(sent for sent, _ in taken) < RATE * (seconds + 1) + 4 * SOCKETS
    assert not any(closed for _, closed in taken)


async def test_without_an_end_the_line_is_cut_in_the_end(url, monkeypatch):
    monkeypatch.setattr(prompt, "HEAD", 0.5)
    begun = time.monotonic()
    _, closed = await poured(url, "chunks", 20.0)
    assert closed and time.monotonic() - begun < 10


async def test_what_has_an_end_is_read_and_the_next_request_answered(url):
    reader, writer = await opened(url)
    for _ in range(2):
        writer.write(HEAD + b"Content-Length: %d\r\n\r\n" % RATE)
        await answered(reader)
        writer.write(bytes(RATE))
        await writer.drain()
    writer.write(b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    async with asyncio.timeout(20):
        assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
    writer.close()


async def test_who_sends_all_before_reading_learns_why_it_is_refused(url):
    async with httpx.AsyncClient(timeout=20) as client:
        answer = await client.post(f"{url}nothing", content=bytes(3 * RATE))
        assert answer.status_code in (404, 405)
        assert (await client.get(f"{url}health")).status_code == 200
